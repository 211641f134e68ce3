"""The training of the product's own networks, with torch and scikit-image."""
