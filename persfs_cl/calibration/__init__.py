"""Light, material, tone and lens, fitted to photographs of surfaces that are known."""
