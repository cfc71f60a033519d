"""Windows for a band of frequencies and a sensor."""
