"""Everything that touches OpenCL: devices, programs, launches. It sees arrays and numbers, never a camera."""
