"""Regression check: are the stored histories still reproduced?"""
