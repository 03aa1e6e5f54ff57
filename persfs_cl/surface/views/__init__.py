"""What a surface looks like, drawn from few of its pixels: small pictures, and a relief that turns in a browser."""
