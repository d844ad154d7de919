"""Sampled grids: the lattice and its simplices, the tube of an isovalue, models, passes and layers."""
