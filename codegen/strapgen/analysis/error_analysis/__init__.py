"""The whole analysis of a step: series, growth, agreement with runs, ratios to other methods."""
