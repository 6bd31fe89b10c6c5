"""What jobs ask of a cluster, and what it says when it ends them."""
