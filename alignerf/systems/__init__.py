"""Systems of other papers, composed of the same parts: refine (BARF, CamP)."""
