"""What rounding, the method and the samples cost on a run that is recorded, in numbers with a proved radius."""
