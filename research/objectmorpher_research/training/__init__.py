"""How the product's own networks are made: needs torch and scikit-image; nothing else uses it."""
