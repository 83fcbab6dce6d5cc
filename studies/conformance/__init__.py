"""Does a solver obey the rules of the interface?"""
