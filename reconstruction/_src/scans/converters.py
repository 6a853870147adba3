"""Files that are not read, and the tools that turn them into files that are."""

_ROS = (
    "save its clouds as .pcd: `ros2 run pcl_ros pointcloud_to_pcd --ros-args -r input:=TOPIC` while `ros2 bag play` "
    "plays it (ROS 1: `rosrun pcl_ros bag_to_pcd`)"
)
_PACKETS = "export the frames as .las or .pcd with the maker's viewer (VeloView, Ouster Studio, PandarView)"
_CAD = "export it from the CAD program, or from FreeCAD, as .stl or .glb"
_BLENDER = "export it from Blender as .glb"

CONVERTERS = {
    ".bag": _ROS,
    ".db3": _ROS,
    ".mcap": _ROS,
    ".pcap": _PACKETS,
    ".pcapng": _PACKETS,
    ".rcp": "export it from Autodesk ReCap as .e57",
    ".rcs": "export it from Autodesk ReCap as .e57",
    ".fls": "export it from FARO SCENE as .e57",
    ".fws": "export it from FARO SCENE as .e57",
    ".lsproj": "export it from FARO SCENE as .e57",
    ".zfs": "export it from Z+F LaserControl as .e57",
    ".zfprj": "export it from Z+F LaserControl as .e57",
    ".imp": "export it from Leica Cyclone as .e57",
    ".lgs": "export it from Leica Cyclone as .e57",
    ".rxp": "export it from RIEGL RiSCAN PRO as .e57 or .las",
    ".rdbx": "export it from RIEGL RiSCAN PRO as .e57 or .las",
    ".ptx": "open it in CloudCompare and save it as .e57, which keeps the scanner's positions",
    ".bin": "open it in CloudCompare and save it as .ply or .e57",
    ".dp": "export it from Dot3D as .e57 or .ply",
    ".tif": "give the intrinsics of the camera if it is a depth image (`--intrinsics`); an elevation model becomes "
    ".xyz by `gdal_translate -of XYZ`",
    ".zip": "unpack it, and give one of its files",
    ".7z": "unpack it, and give one of its files",
    ".xz": "unpack it with `unxz`",
    ".zst": "unpack it with `unzstd`",
    ".vtp": "save it from ParaView as .ply",
    ".vtu": "save it from ParaView as .ply",
    ".usd": _BLENDER,
    ".usdz": _BLENDER,
    ".usda": _BLENDER,
    ".usdc": _BLENDER,
    ".fbx": _BLENDER,
    ".blend": _BLENDER,
    ".3ds": _BLENDER,
    ".step": _CAD,
    ".stp": _CAD,
    ".iges": _CAD,
    ".igs": _CAD,
    ".hdf5": "save its points as .npy or .npz",
    ".h5": "save its points as .npy or .npz",
    ".mat": "save its points as .csv: writematrix(points, 'points.csv')",
    ".parquet": "save its columns x, y, z as .csv",
}
"""Ending of a file that is not read -> what to do with it."""
