"""What holds at the extremes of length, step, parameters, time and deformation?"""
