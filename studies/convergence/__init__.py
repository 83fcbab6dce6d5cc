"""How does an error fall with mesh and step?"""
