"""Made-up vessels with handles, for the network that finds how a handle lies about the axis."""
