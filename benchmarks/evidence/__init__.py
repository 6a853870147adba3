"""What a user decides by: measured by public names alone, judged by libigl, trimesh and MuJoCo."""
