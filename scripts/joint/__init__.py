"""What the tables of the joint estimate share: surveys matched once, rivals of the link model, scores."""
