"""The study of `objectmorpher study`: who is shown what, what they answer, and what that says."""
