"""The other side of the network, as a program of somebody else would be: eclipse-zenoh from PyPI and nothing of ours.

    swarm.py router ENDPOINT                         a router, until it is killed
    swarm.py compared ENDPOINT NODE OTHER COUNT       what two nodes make of each other, one JSON object a line
    swarm.py fly ENDPOINT NODE CAMERA COUNT HZ FRAME [LEASE_MS]
                                                     sends a JPEG COUNT times, tells as JSON what came back; a link that is silent for
                                                     LEASE_MS is given up and made anew
    swarm.py share ...                               as fly, in shared memory: of this Zenoh takes back what a starved machine does
                                                     not confirm in time
    swarm.py ask ENDPOINT NODE CALL JSON             one query, its reply
"""

import json
import sys
import threading
import time

import zenoh


def config(mode, key, endpoint, shared=False):
    made = zenoh.Config()
    made.insert_json5("transport/shared_memory/enabled", json.dumps(shared))
    made.insert_json5("mode", json.dumps(mode))
    made.insert_json5(f"{key}/endpoints", json.dumps([endpoint]))
    made.insert_json5("scouting/multicast/enabled", "false")
    if key == "connect":
        made.insert_json5("connect/timeout_ms", "-1")
        made.insert_json5("connect/exit_on_failure", "false")
    return made


def router(endpoint):
    with zenoh.open(config("router", "listen", endpoint)):
        print("ready", flush=True)
        threading.Event().wait()


def fly(endpoint, node, camera, count, rate, path, lease=None, shared=False):
    with open(path, "rb") as file:
        frame = file.read()
    base = f"skypose/v1/default/{node}/camera/{camera}"
    estimates, statuses = [], []

    def on_estimate(sample):
        note = json.loads(sample.attachment.to_string())
        reply = json.loads(sample.payload.to_string())
        note["range_m"] = [target["pose"] and target["pose"]["range_m"] for target in reply["targets"]]
        note["encoding"] = str(sample.encoding)
        note["age_us"] = int(time.time() * 1e6) - note["timestamp_us"]
        estimates.append(note)

    made = config("client", "connect", endpoint, shared)
    if lease:
        made.insert_json5("transport/link/tx/lease", lease)
    with zenoh.open(made) as session:
        watching = session.declare_subscriber(f"{base}/estimate", on_estimate)
        told = session.declare_subscriber(f"{base}/status", lambda s: statuses.append(json.loads(s.payload.to_string())))
        # Who is not there yet is waited for.
        start = time.time()
        while time.time() - start < 20 and not any(status["has_stream"] for status in statuses):
            time.sleep(0.05)
        print("flying", flush=True)
        frames = session.declare_publisher(f"{base}/frame", encoding=zenoh.Encoding.IMAGE_JPEG)
        start = time.time()
        for sequence in range(count):
            time.sleep(max(0.0, start + sequence / rate - time.time()))
            note = {"sequence": sequence, "timestamp_us": int(time.time() * 1e6)}
            frames.put(frame, attachment=json.dumps(note))
        start = time.time()
        while time.time() - start < 20 and not any(status.get("last_sequence") == count - 1 for status in statuses):
            time.sleep(0.05)
        time.sleep(1.5)
        del watching, told
    print(json.dumps({"sent": count, "estimates": estimates, "status": statuses[-1] if statuses else None}))


def compared(endpoint, node, other, count):
    with zenoh.open(config("client", "connect", endpoint)) as session:
        told = session.declare_subscriber(f"skypose/v1/default/{node}/body/{other}/agreement")
        print("listening", flush=True)
        for _ in range(count):
            sample = told.recv()
            agreement = json.loads(sample.payload.to_string())
            fused = agreement["fused"]
            line = {"verdict": agreement["verdict"], "encoding": str(sample.encoding), "fused": fused and fused["translation_m"]}
            print(json.dumps(line), flush=True)


def ask(endpoint, node, call, text):
    with zenoh.open(config("client", "connect", endpoint)) as session:
        time.sleep(0.5)
        for reply in session.get(f"skypose/v1/default/{node}/rpc/{call}", payload=text, timeout=10):
            if reply.ok:
                print(json.dumps({"ok": json.loads(reply.ok.payload.to_string())}))
            else:
                print(json.dumps({"error": json.loads(reply.err.payload.to_string())}))


def main(command, *arguments):
    if command == "router":
        router(*arguments)
    elif command in ("fly", "share"):
        endpoint, node, camera, count, rate, path, *lease = arguments
        fly(endpoint, node, camera, int(count), float(rate), path, *lease, shared=command == "share")
    elif command == "compared":
        endpoint, node, other, count = arguments
        compared(endpoint, node, other, int(count))
    elif command == "ask":
        ask(*arguments)
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main(*sys.argv[1:])
