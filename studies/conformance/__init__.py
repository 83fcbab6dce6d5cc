"""Does a solver keep the rules of the interface?"""
