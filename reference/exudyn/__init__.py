"""Models of scenes in Exudyn (Gerstmayr 2023, DOI 10.1007/s11044-023-09937-1), whose coordinates are displacements."""
