"""The machine: signals, durable files, compiled code, memory and processes."""
