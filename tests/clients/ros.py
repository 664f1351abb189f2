"""The other side of ROS 2 over Zenoh: eclipse-zenoh and rosbags from PyPI, which reads and writes CDR by definitions of its own.

    ros.py hashes                                  the types' hashes, by name, for every distribution that has them
    ros.py decode TYPE HEX                         one message as JSON
    ros.py fly ENDPOINT JSON                       publishes CameraInfo and pictures as rmw_zenoh or the bridge would, tells what came back

JSON of `fly`: form, domain, hash (true or false), image, camera_info, pose, frame (a path), count, k, d, model, size, big_endian.
"""

import json
import struct
import sys
import time

import numpy
from rosbags.typesys import Stores, get_typestore

IMAGE = "sensor_msgs/msg/CompressedImage"
INFO = "sensor_msgs/msg/CameraInfo"
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
DISTRIBUTIONS = ["ROS2_IRON", "ROS2_JAZZY", "ROS2_KILTED"]


def hashes():
    told = {}
    for name in DISTRIBUTIONS:
        store = get_typestore(getattr(Stores, name))
        for kind in [IMAGE, INFO, POSE]:
            told.setdefault(kind, []).append(store.hash_rihs01(kind))
    print(json.dumps(told))


def plain(value):
    if isinstance(value, numpy.ndarray):
        return value.tolist()
    if hasattr(value, "__dataclass_fields__"):
        return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__ if name != "__msgtype__"}
    return value


def key(wanted, topic, kind, store):
    name = topic.lstrip("/")
    if wanted["form"] == "bridge":
        return name
    package, _, short = kind.split("/")
    return f"{wanted['domain']}/{name}/{package}::msg::dds_::{short}_/{type_hash(wanted, kind, store)}"


def type_hash(wanted, kind, store):
    return store.hash_rihs01(kind) if wanted["hash"] else "TypeHashNotSupported"


def fly(endpoint, wanted):
    import zenoh

    wanted = json.loads(wanted)
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    # What is shared may be taken back on a starved machine; each picture counts here.
    config.insert_json5("transport/shared_memory/enabled", "false")
    poses, tokens = [], []

    def on_pose(sample):
        told = plain(store.deserialize_cdr(sample.payload.to_bytes(), POSE))
        note = sample.attachment
        note = note and note.to_bytes()
        # 8 bytes of sequence, 8 of nanoseconds, the length of the name, the name.
        told["attachment"] = note and {
            "sequence": struct.unpack("<q", note[:8])[0],
            "source_ns": struct.unpack("<q", note[8:16])[0],
            "gid": note[17:].hex(),
            "rest": [note[16], len(note)],
        }
        told["key"] = str(sample.key_expr)
        poses.append(told)

    def header(stamp):
        return types["std_msgs/msg/Header"](
            stamp=types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9),
            frame_id="front_optical",
        )

    def written(message, kind):
        return store.serialize_cdr(message, kind, little_endian=not wanted.get("big_endian", False))

    with zenoh.open(config) as session:
        hears = session.declare_subscriber(key(wanted, wanted["pose"], POSE, store), on_pose)
        lives = session.liveliness().declare_subscriber("@ros2_lv/**", lambda s: tokens.append(str(s.key_expr)), history=True)
        if wanted["camera_info"]:
            region = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
            width, height = wanted["size"]
            info = types[INFO](
                header(time.time_ns()), height, width, wanted["model"], numpy.array(wanted["d"], dtype=float),
                numpy.array(wanted["k"], dtype=float), numpy.eye(3).ravel(), numpy.zeros(12), 0, 0, region,
            )
            time.sleep(1.0)
            session.put(key(wanted, wanted["camera_info"], INFO, store), bytes(written(info, INFO)))
        print("informed", flush=True)
        # Until the other side has what it needs.
        sys.stdin.readline()
        with open(wanted["frame"], "rb") as file:
            data = numpy.frombuffer(file.read(), dtype=numpy.uint8)
        stamps = []
        for sequence in range(1, wanted["count"] + 1):
            stamp = time.time_ns()
            stamps.append(stamp)
            image = types[IMAGE](header(stamp), "rgb8; jpeg compressed bgr8", data)
            note = struct.pack("<qqB", sequence, stamp, 16) + bytes(range(16))
            place = key(wanted, wanted["image"], IMAGE, store)
            attachment = note if wanted["form"] == "rmw_zenoh" else None
            session.put(place, bytes(written(image, IMAGE)), attachment=attachment)
            start = time.time()
            while len(poses) < sequence and time.time() - start < wanted.get("patience_s", 15):
                time.sleep(0.01)
        time.sleep(0.3)
        del hears, lives
    print(json.dumps({"stamps": stamps, "poses": poses, "tokens": sorted(set(tokens))}))


def decode(kind, text):
    store = get_typestore(Stores.ROS2_JAZZY)
    print(json.dumps(plain(store.deserialize_cdr(bytes.fromhex(text), kind))))


if __name__ == "__main__":
    command, arguments = sys.argv[1], sys.argv[2:]
    {"hashes": hashes, "fly": fly, "decode": decode}[command](*arguments)
