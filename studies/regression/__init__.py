"""Do scenes still move as their stored histories say?"""
