"""What a described system consists of, as text, as JSON and as a drawing."""
