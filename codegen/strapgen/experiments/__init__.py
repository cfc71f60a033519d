"""What is measured with back ends: orders, tables, word lengths, agreement. Computed here, printed elsewhere."""
