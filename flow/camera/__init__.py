"""How much of a flow a moved camera explains (exact reprojection, a robust fit)."""
