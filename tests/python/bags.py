"""A ROS 2 bag (MCAP) as others record one: joint states while the arm moves, and what a tracker saw of the tool."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType
from mcap_ros2.writer import Writer

LINE = "=" * 80
HEADER = (
    f"\n{LINE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    f"{LINE}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)
POINT = f"{LINE}\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
VECTOR = f"{LINE}\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
QUATERNION = f"{LINE}\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
TEXTS = {
    "sensor_msgs/msg/JointState": "std_msgs/Header header\nstring[] name\n"
    + "float64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    + HEADER,
    "geometry_msgs/msg/PointStamped": "std_msgs/Header header\ngeometry_msgs/Point point\n" + HEADER + POINT,
    "geometry_msgs/msg/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose\n"
    + HEADER
    + f"{LINE}\nMSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
    + POINT
    + QUATERNION,
    "geometry_msgs/msg/TransformStamped": "std_msgs/Header header\nstring child_frame_id\n"
    + "geometry_msgs/Transform transform\n"
    + HEADER
    + f"{LINE}\nMSG: geometry_msgs/Transform\ngeometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"
    + VECTOR
    + QUATERNION,
}
TEXTS["tf2_msgs/msg/TFMessage"] = (
    "geometry_msgs/TransformStamped[] transforms\n"
    + f"{LINE}\nMSG: geometry_msgs/TransformStamped\n"
    + TEXTS["geometry_msgs/msg/TransformStamped"]
)


def _header(t: float) -> dict[str, Any]:
    return {"stamp": {"sec": int(t), "nanosec": round((t - int(t)) * 1e9)}, "frame_id": "tracker"}


def _said(kind: str, t: float, p: np.ndarray, q: np.ndarray) -> dict[str, Any]:
    place = dict(zip("xyz", map(float, p), strict=True))
    turn = dict(zip("wxyz", map(float, q), strict=True))
    if kind == "TFMessage":  # beside another frame, which is somewhere else
        one = _said("TransformStamped", t, p, q)
        other = _said("TransformStamped", t, p + 1.0, q) | {"child_frame_id": "link_1"}
        return {"transforms": [other, one]}
    if kind == "PointStamped":
        return {"header": _header(t), "point": place}
    if kind == "PoseStamped":
        return {"header": _header(t), "pose": {"position": place, "orientation": turn}}
    return {"header": _header(t), "child_frame_id": "probe", "transform": {"translation": place, "rotation": turn}}


def write_bag(
    path: Path,
    joints: np.ndarray,
    positions: np.ndarray,
    quaternions: np.ndarray,
    names: list[str],
    kind: str = "PoseStamped",
    compression: CompressionType = CompressionType.ZSTD,
) -> None:
    """Half a second at each of `joints` (n, dof; in the order of `names`), half a second on the way to the next.

    States at 50 Hz, sights at 10 Hz.
    """
    t = 1_700_000_000.0
    with path.open("wb") as f:
        writer = Writer(f, compression=compression)
        schemas = {name: writer.register_msgdef(name, text) for name, text in TEXTS.items()}
        state, seen = (
            schemas["sensor_msgs/msg/JointState"],
            schemas[f"tf2_msgs/msg/{kind}" if kind == "TFMessage" else f"geometry_msgs/msg/{kind}"],
        )

        def send(topic: str, schema: Any, message: dict[str, Any], at: float) -> None:
            # the recorder gets everything 20 ms later
            ns = round((at + 0.02) * 1e9)
            writer.write_message(topic=topic, schema=schema, message=message, log_time=ns, publish_time=ns)

        for k, q in enumerate(joints):
            after = joints[min(k + 1, len(joints) - 1)]
            for step in range(50):
                moved = max(0.0, (step - 25) / 25) if k + 1 < len(joints) else 0.0
                now = q + (after - q) * moved
                message = {"header": _header(t), "name": names, "position": now.tolist(), "velocity": [], "effort": []}
                send("/joint_states", state, message, t)
                if step % 5 == 0:
                    # on the way the tracker sees it somewhere between
                    send(
                        "/tf" if kind == "TFMessage" else "/tracker/tool",
                        seen,
                        _said(kind, t, positions[k] + 0.1 * moved, quaternions[k]),
                        t,
                    )
                t += 0.02
        writer.finish()
