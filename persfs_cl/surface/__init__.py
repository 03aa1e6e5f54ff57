"""What a depth map is as a surface: points, normals, mesh, pictures, and how far to believe it."""
