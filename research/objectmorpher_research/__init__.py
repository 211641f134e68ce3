"""The laboratory beside the program: training, evaluation, benchmarks and the user study."""
