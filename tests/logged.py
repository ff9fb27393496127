"""Logs records by `python -m gdg_tui.log` to each service that is installed, and reads them back.

    python tests/logged.py FOLDER    with a.jsonl, b.jsonl (the run resumed), jobs/ and pictures/

Nothing is sent anywhere. What is one curve is tried without any service first. Prints the services that are not installed.
"""

import importlib.util
import json
import os
import pathlib
import sqlite3
import struct
import subprocess
import sys

import gdg_tui.log

os.chdir(sys.argv[1])
os.environ |= {"WANDB_MODE": "offline", "TRACKIO_DIR": "trackio", "HF_HUB_OFFLINE": "1"}
os.environ["MLFLOW_TRACKING_URI"] = "sqlite:///ml.db"
RECORDS = [json.loads(line) for name in "ab" for line in pathlib.Path(f"{name}.jsonl").open()]
CURVE = {r["updates"]: r["alone"]["success"] for r in RECORDS if r["event"] == "evaluation"}
METRIC = "alone/success"


def log(service, *files, given=None):
    command = [sys.executable, "-m", "gdg_tui.log", "--to", service, *map(str, files)]
    done = subprocess.run(command, stdin=given, capture_output=True, text=True)
    assert done.returncode == 0 and "not logged" not in done.stderr, done.stderr


class Recorder:
    """A service that keeps the steps of each run."""

    steps = {}

    def __init__(self, project, name, config, first):
        self.own = Recorder.steps.setdefault(name, [])

    def log(self, values, step):
        self.own.append(step)

    def picture(self, path, step):
        pass

    def close(self):
        pass


def curves(*changes):
    """Returns the steps of evaluations in each curve, of the records in b.jsonl and a.jsonl with changes."""
    files, Recorder.steps = [], {}
    for number, (name, start, more) in enumerate(changes):
        first, *rest = (json.loads(line) for line in pathlib.Path(f"{name}.jsonl").open())
        rest = [record for record in rest if record["event"] in ("evaluation", "saved")]
        files.append(f"changed{number}.jsonl")
        records = [{**first, **start}, *more, *rest]
        pathlib.Path(files[-1]).write_text("".join(json.dumps(record) + "\n" for record in records))
    assert gdg_tui.log.main(["--to", "recorder", *files]) == 0
    return sorted(map(sorted, Recorder.steps.values()))


def tensorboard():
    from tensorboard.backend.event_processing.event_multiplexer import EventMultiplexer

    events = EventMultiplexer().AddRunsFromDirectory("gdg-tui")
    events.Reload()
    for run, tags in events.Runs().items():
        points = {event.step: event.value for event in events.Scalars(run, METRIC)}
        yield run, points, bool(tags["images"])


def mlflow():
    from mlflow import MlflowClient

    client = MlflowClient()
    for run in client.search_runs([client.get_experiment_by_name("gdg-tui").experiment_id]):
        history = client.get_metric_history(run.info.run_id, METRIC)
        points = {point.step: point.value for point in history}
        assert run.data.params["method"] == "gdg-bridge" and run.info.status == "FINISHED"
        yield run.info.run_name, points, bool(client.list_artifacts(run.info.run_id))


def trackio():
    runs = {}
    database = sqlite3.connect("trackio/gdg-tui.db")
    for run, step, metrics in database.execute("select run_name, step, metrics from metrics"):
        points, pictures, metrics = *runs.setdefault(run, ({}, [])), json.loads(metrics)
        points |= {step: metrics[METRIC]} if METRIC in metrics else {}
        pictures += ["map"] if "map" in metrics else []
    yield from ((run, points, bool(pictures)) for run, (points, pictures) in runs.items())


def wandb():
    from wandb.proto.wandb_internal_pb2 import Record

    runs, names = {}, {}
    for path in sorted(pathlib.Path("wandb").glob("offline-run-*/*.wandb")):
        # Blocks of 32 KiB, in which a header tells length and kind of a part of a record.
        data, at, whole, own = path.read_bytes(), 7, b"", path.stem.removeprefix("run-")
        while at + 7 <= len(data):
            if (left := 32768 - at % 32768) < 7:
                at += left
                continue
            _, length, kind = struct.unpack("<IHB", data[at : at + 7])
            whole, at = whole + data[at + 7 : at + 7 + length], at + 7 + length
            if kind not in (1, 4):
                continue
            record, whole = Record.FromString(whole), b""
            names |= {own: record.run.display_name} if record.HasField("run") else {}
            items = ((item.key or "/".join(item.nested_key), item) for item in record.history.item)
            values = {key: json.loads(item.value_json) for key, item in items}
            points, pictures = runs.setdefault(own, ({}, []))
            points |= {values["_step"]: values[METRIC]} if METRIC in values else {}
            pictures += [key for key in values if key.startswith("map")]
    yield from ((names[own], points, bool(pictures)) for own, (points, pictures) in runs.items())


gdg_tui.log.SERVICES["recorder"] = Recorder
RESUMED, BEGUN, WHOLE = ("b", {}, []), ("a", {}, []), sorted(CURVE)
assert curves(RESUMED, BEGUN) == [WHOLE], "in any order"
moved = {"data": {"file": "a.npz", "checksum": 1}, "gym": {"id": "Point-v0", "workers": 1}}
elsewhere = {"data": {"file": "b.npz", "checksum": 1}, "gym": {"id": "Point-v0", "workers": 3}}
assert curves(("b", elsewhere, []), ("a", moved, [])) == [WHOLE]
HALF = WHOLE[: len(WHOLE) // 2]
for other in {"eval_tasks": 9}, {"edit_at": ["150:3 x 3, a"]}, {"fingerprint": "3 x 3, b"}:
    assert curves(BEGUN, ("a", other, [])) == [HALF, HALF], other
assert curves(("a", {"settings": 5}, [])) == [HALF], "it is no list"
edit = {"event": "edit", "updates": 150}
edited = ("b", {"fingerprint": "3 x 3, a", "eval_tasks": 9}, [])
assert curves(edited, ("a", {"edit_at": ["150:3 x 3, a"]}, [edit])) == [sorted([150, *WHOLE])]
(job,) = pathlib.Path("jobs").glob("*.json")
os.chdir("jobs")
Recorder.steps = {}
assert gdg_tui.log.main(["--to", "recorder", job.name]) == 0
os.chdir("..")
(name,) = Recorder.steps
assert name.startswith("fourrooms-gdg-bridge-hidden=16") and int(name[-12:], 16), name
for name, text in [("map.txt", "S.G"), ("list.json", "[1]"), ("job.json", "{}"), ("none.jsonl", None)]:
    if text:
        pathlib.Path(name).write_text(text)
    command = [sys.executable, "-m", "gdg_tui.log", "--to", "mlflow", "a.jsonl", name]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1) and name in done.stderr, done

for read in tensorboard, mlflow, trackio, wandb:
    service = read.__name__
    if importlib.util.find_spec(service) is None:
        print(f"{service} is not installed")
        continue
    # A line that is cut off, as of a run that still writes it, is left out.
    pathlib.Path("cut.jsonl").write_text(pathlib.Path("a.jsonl").read_text() + '{"event":"progr')
    log(service, "cut.jsonl")
    with open("b.jsonl") as records:
        log(service, given=records)
    log(service, *pathlib.Path("jobs").glob("*.json"))
    (job, whole, has_picture), (run, points, _) = sorted(read(), key=lambda run: -run[2])
    near = {step: abs(value - CURVE[step]) < 1e-6 for step, value in points.items()}
    assert points.keys() == CURVE.keys() and all(near.values()), (service, points, CURVE)
    assert has_picture and len(whole) == 10, (service, job, whole)
    assert run.startswith("fourrooms-gdg-bridge-hidden=16") and run[-12:] != job[-12:]
    print(f"{service}: a resumed run and a job")
