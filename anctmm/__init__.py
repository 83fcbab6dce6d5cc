"""ANC-TMM: absolute nodal coordinate transfer matrix method for planar large-deformation flexible beams."""
