"""What does a step cost, and against whom?"""
