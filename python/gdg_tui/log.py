"""Logs runs to Weights & Biases, Trackio, TensorBoard or MLflow, from the records of gdg-tui.

    gdg-tui --no-ui fourrooms --max-updates 20000 | tee -ip run.jsonl | python -m gdg_tui.log --to wandb
    python -m gdg_tui.log run.jsonl resumed.jsonl --to tensorboard
    python -m gdg_tui.log saves/suite/jobs/*.json --to mlflow

Records are lines of JSON as `--no-ui` writes them, of files or of standard input while the run goes
on, or results of the jobs of `suite` and `reproduce`. The step is the number of updates. A run has
the same ID whenever it is logged: what is resumed goes on in its curve. Where a service fails, that is
said, and records are read on to their end: with `tee -ip`, no failure here ends the training.
"""

from __future__ import annotations

import argparse
import hashlib
import itertools
import json
import pathlib
import re
import signal
import sys
import time
from typing import Any, Callable, Iterable, Iterator

ID_LENGTH = 12

# What tells runs apart, besides the world's name, its tasks and data. The key is that of a job.
APART = "fingerprint method variant preset settings seed version eval_tasks edit_at key".split()


class WandB:
    def __init__(self, project: str, name: str, config: dict[str, Any], first: int) -> None:
        import wandb

        # With this ID, what the service has already is left out: a resumed run repeats some of it.
        self.image, own = wandb.Image, name[-ID_LENGTH:]
        self.run = wandb.init(project=project, id=own, name=name, config=config, resume="allow")

    def log(self, values: dict[str, float], step: int) -> None:
        self.run.log(values, step=step)

    def picture(self, path: pathlib.Path, step: int) -> None:
        self.run.log({"map": self.image(str(path))}, step=step)

    def close(self) -> None:
        self.run.finish()


class Trackio(WandB):
    def __init__(self, project: str, name: str, config: dict[str, Any], first: int) -> None:
        import trackio

        self.image = trackio.Image
        self.run = trackio.init(project=project, name=name, config=config, resume="allow")


class TensorBoard:
    """Event files in a folder, one below it for each run."""

    def __init__(self, project: str, name: str, config: dict[str, Any], first: int) -> None:
        from tensorboard.compat.proto import event_pb2, summary_pb2
        from tensorboard.plugins.hparams.summary_v2 import hparams_pb
        from tensorboard.summary.writer.event_file_writer import EventFileWriter

        self.event, self.summary = event_pb2.Event, summary_pb2.Summary
        self.writer = EventFileWriter(str(pathlib.Path(project, name)))
        # What follows replaces what the run had logged after it was saved.
        start = event_pb2.SessionLog(status=event_pb2.SessionLog.START)
        self.write(first + 1, session_log=start)
        self.write(first, summary=hparams_pb(config, trial_id=name))

    def write(self, step: int, **what: Any) -> None:
        self.writer.add_event(self.event(step=step, wall_time=time.time(), **what))
        self.writer.flush()

    def log(self, values: dict[str, float], step: int) -> None:
        own = [self.summary.Value(tag=tag, simple_value=value) for tag, value in values.items()]
        self.write(step, summary=self.summary(value=own))

    def picture(self, path: pathlib.Path, step: int) -> None:
        data = path.read_bytes()
        width, height = (int.from_bytes(data[at : at + 4], "big") for at in (16, 20))
        image = {"width": width, "height": height, "colorspace": 3, "encoded_image_string": data}
        value = self.summary.Value(tag="map", image=self.summary.Image(**image))
        self.write(step, summary=self.summary(value=[value]))

    def close(self) -> None:
        self.writer.close()


class MLflow:
    def __init__(self, project: str, name: str, config: dict[str, Any], first: int) -> None:
        import mlflow

        self.mlflow, own = mlflow, name[-ID_LENGTH:]
        mlflow.set_experiment(project)
        known = mlflow.search_runs(filter_string=f"tags.gdg_run = '{own}'", output_format="list")
        if known:
            mlflow.start_run(run_id=known[0].info.run_id)
        else:
            mlflow.start_run(run_name=name, tags={"gdg_run": own})
            mlflow.log_params(config)

    def log(self, values: dict[str, float], step: int) -> None:
        self.mlflow.log_metrics(values, step=step)

    def picture(self, path: pathlib.Path, step: int) -> None:
        self.mlflow.log_artifact(str(path))

    def close(self) -> None:
        self.mlflow.end_run()


SERVICES = {"wandb": WandB, "trackio": Trackio, "tensorboard": TensorBoard, "mlflow": MLflow}


# What records were called before.
NOW = {"greedy": "alone", "distance_error": "error", "coverage": "explored"}


def flat(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yields what a record contains, by names such as `planned/success`, old ones by those of today."""
    parts = enumerate(value, 1) if isinstance(value, list) else None
    parts = value.items() if isinstance(value, dict) else parts
    if parts is not None:
        for key, part in parts:
            key = NOW.get(key, key)
            yield from flat(part, f"{name}/{key}" if name else str(key))
    elif value is not None:
        yield name, value


class NoRecords(Exception):
    """A file is neither records nor a job's result."""


def read(path: pathlib.Path) -> list[list[dict[str, Any]]]:
    """Returns the records of a file or what a job's result amounts to, in parts that each begin with
    `start`."""
    if path.is_fifo():
        say(f"{path}: a pipe, read to its end before it is logged; standard input is logged as it comes")
    try:
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise NoRecords(f"{path}: cannot be read: {error.strerror}") from error
    if path.suffix == ".json":
        try:
            job = dict(json.loads(text))
            evaluations = [{"event": "evaluation", **dict(at)} for at in job.pop("evaluations")]
        except (KeyError, RecursionError, TypeError, ValueError) as error:
            raise NoRecords(f"{path}: no result of a job") from error
        end = {"event": "end", "picture": path.absolute().parents[1] / "pictures" / f"{path.stem}.png"}
        return [[{"event": "start", **job, "updates": 0}, *evaluations, end]]
    parts, notes = [], []
    for record in records(text.splitlines(), str(path), notes.append):
        if record.get("event") == "start":
            parts.append([])
        if parts:
            parts[-1].append(record)
    if not parts:
        raise NoRecords(f"{path}: no records of a run: these begin with its start")
    for note in notes:
        say(note)
    return parts


def records(lines: Iterable[str], source: str, note: Callable[[str], None]) -> Iterator[dict[str, Any]]:
    """Yields the records among lines."""
    for number, line in enumerate(lines, 1):
        try:
            yield dict(json.loads(line))
        except (RecursionError, TypeError, ValueError):
            note(f"{source}:{number}: no record, left out")


def begun(part: list[dict[str, Any]]) -> int:
    """Returns the updates at which a part begins."""
    updates = part[0].get("updates")
    return updates if isinstance(updates, int) else 0


def described(start: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """Returns the name of a run, which ends in its ID, and its configuration.

    The ID follows from what `gdg-tui plot` tells runs apart by: not from where files are, or how many
    processes and threads share the work.
    """
    part = lambda name: start[name] if isinstance(start.get(name), dict) else {}
    world = start.get("map", start.get("world"))
    world = part("map").get("name") or part("gym").get("id") or (world if isinstance(world, str) else None)
    own = [world, part("map").get("scenario"), part("data").get("checksum")]
    key = json.dumps([*own, *map(start.get, APART)], sort_keys=True)
    key = hashlib.sha256(key.encode()).hexdigest()[:ID_LENGTH]
    settings = start.get("settings")
    if isinstance(settings, dict):
        settings = [f"{name}={value}" for name, value in settings.items()]
    settings = settings if isinstance(settings, list) else []
    name = "-".join(map(str, [world, start.get("method"), *settings, start.get("seed"), key]))
    plain = lambda value: value if isinstance(value, (int, float)) else str(value)
    varies = ("event", "updates", "resumed", "threads", "seconds")
    config = {part: plain(value) for part, value in flat(start) if part not in varies}
    return re.sub(r"[^\w.=+-]+", "_", name), config


def goes_on(start: dict[str, Any], before: dict[str, Any]) -> bool:
    """Whether a run goes on in another's curve, from whose checkpoint it was resumed: also on other
    evaluation tasks, or where its map was edited."""
    same = lambda *names: all(start.get(name) == before.get(name) for name in names)
    return same("method", "settings", "seed") and bool(before.get("edited") or same("fingerprint"))


def numbers(event: str, record: dict[str, Any]) -> dict[str, float]:
    """Returns what is logged of a record: of tasks by distance, success alone."""
    prefix = "" if event in ("evaluation", "progress") else f"{event}/"
    found = ((prefix + name, value) for name, value in flat(record) if name != "updates")
    is_shown = lambda name: "/by_distance/" not in name or name.endswith("/success")
    return {name: float(v) for name, v in found if is_shown(name) and isinstance(v, (int, float))}


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def show(run: Any, picture: pathlib.Path, step: int) -> None:
    try:
        run.picture(picture, step)
    except Exception as error:  # Each service has its own; wandb needs pillow for pictures.
        say(f"{picture} was not logged: {error}")


def log(options: argparse.Namespace) -> int:
    """Logs all records; returns of how many runs."""
    parts = [part for path in options.files for part in read(path)]
    # What is resumed comes after what it goes on from, as services may drop what is beyond.
    parts.sort(key=begun)
    given = itertools.chain.from_iterable(parts)
    if not options.files:
        given = records(sys.stdin, "standard input", say)
    run, step, runs, own, saved = None, 0, 0, {}, {}
    for record in given:
        event, step = record.pop("event", None), record.get("updates", step)
        picture = record.get("picture") or options.picture
        if run and event == "end" and picture and picture.is_file():
            show(run, picture, step)
        if run and event in ("start", "end"):
            run.close()
            run = None
        if event == "start":
            name, config = described(record)
            before, own = saved.get(record.get("resumed")), {**record, "name": name}
            if before and goes_on(own, before):
                own = {**own, "name": before["name"], "edited": before.get("edited")}
            run = SERVICES[options.to](options.project, own["name"], config, step)
            runs += 1
        elif run and event == "saved":
            saved[record.get("path")] = own
        elif run:
            own["edited"] = own.get("edited") or event == "edit"
            run.log(numbers(event, record), step)
    if run:
        run.close()
    return runs


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m gdg_tui.log", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    add = parser.add_argument
    add("files", nargs="*", type=pathlib.Path, help="records (.jsonl), or results of jobs (.json)")
    add("--to", choices=SERVICES, required=True)
    add("--project", default="gdg-tui", help="project, experiment or folder (default: gdg-tui)")
    add("--picture", type=pathlib.Path, help="a PNG of the map; those of a suite are found")
    options = parser.parse_args(arguments)
    if options.picture and not options.picture.is_file():
        parser.error(f"there is no {options.picture}")
    if not options.files:
        # Ctrl-C ends the trainer, whose last records are still to come.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        sys.stdin.reconfigure(encoding="utf-8-sig", errors="replace")
    try:
        if log(options):
            return 0
        problem = "nothing was logged: there is no start record"
    except NoRecords as error:
        say(str(error))
        return 2
    except ImportError as error:
        problem = f"{error}: pip install {error.name}"
    except Exception as error:  # Each service has its own.
        problem = f"no more is logged: {type(error).__name__}: {error}"
    say(problem)
    # The trainer would fail if nobody read what it still writes.
    for _ in () if options.files else sys.stdin:
        pass
    return 1


if __name__ == "__main__":
    sys.exit(main())
