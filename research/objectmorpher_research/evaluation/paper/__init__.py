"""The paper's table: the measures of every method's results, and the times of making them."""
