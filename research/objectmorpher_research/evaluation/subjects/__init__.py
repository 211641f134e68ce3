"""What methods are compared on: photos with an edit of each, of our folders or a benchmark's."""
