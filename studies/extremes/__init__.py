"""What holds at the extremes of a case?"""
