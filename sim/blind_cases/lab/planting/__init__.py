"""Plants effects and imperfections in a specimen, and determines their visibility."""
