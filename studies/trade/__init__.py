"""Which solver, element, mesh and step costs least for an error?"""
