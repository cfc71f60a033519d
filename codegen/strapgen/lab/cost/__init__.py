"""Cost of generated code on microcontrollers: cross compilers and simulators."""
