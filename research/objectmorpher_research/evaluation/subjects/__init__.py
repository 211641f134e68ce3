"""The subjects of a comparison: photos with an edit of each, in our folders or a benchmark's."""
