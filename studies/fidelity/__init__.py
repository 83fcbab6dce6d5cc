"""Which body may be a cable or rigid, and what does that save?"""
