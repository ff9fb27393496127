"""Tests of the module gdg_tui on policies made up here: files, shapes, observations, actions.

That it computes what the program does is tested by tests/export.rs.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np

import gdg_tui

# As the program finds out about an environment in Python: its second and third number are achieved.
GYM = {
    "id": "Point-v0",
    "package": None,
    "observation": 3,
    "achieved_goal": 2,
    "desired_goal": 2,
    "state_columns": [0, 1, 2],
    "goal_columns": [0, 1],
    "low": [0.0, None],
    "high": [3.0, 5.0],
}


def policy_file(arrays, *contacts, **more):
    """Returns the bytes of a policy with a state of three numbers and one layer."""
    inputs = {
        "state_centre": [0, 0, 0],
        "state_half_range": [1, 1, 0],
        "achieved": [1, 2],
        "fourier_octaves": 1,
        "relative_rates": [1.0],
        "contacts": contacts,
        "contact_scales": [1.0, 2.0],
        "layers": 1,
        "grids": 0,
    }
    header, data = {"__metadata__": {"policy": json.dumps({"inputs": inputs, **more})}}, b""
    for name, array in arrays.items():
        kind = {"f": "F32", "u": "U32"}[array.dtype.kind]
        span = [len(data), len(data) + array.nbytes]
        header[name] = {"dtype": kind, "shape": array.shape, "data_offsets": span}
        data += array.tobytes()
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + data


def actor(bias):
    """Returns the weights of an actor that always does the same."""
    width = 3 + 4 + 2 + 4 + 2
    shapes = {"layer0.weight": (width, 4), "layer0.bias": 4, "output.weight": (2, 4)}
    arrays = {name: np.zeros(shape, "<f4") for name, shape in shapes.items()}
    return {**arrays, "output.bias": np.arctanh(np.array(bias, "<f4"))}


class Module(unittest.TestCase):
    def load(self, data):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "run.policy.safetensors")
            path.write_bytes(data)
            return gdg_tui.load_policy(path)

    def test_actions_are_those_of_the_program_without_an_interface(self):
        policy = self.load(policy_file(actor([0.5, -0.5])))
        self.assertEqual((policy.state_dim, policy.goal_dim, policy.action_dim), (3, 2, 2))
        np.testing.assert_allclose(policy([0, 1, 2], [3, 4]), [0.5, -0.5], atol=1e-6)
        self.assertEqual(policy(np.zeros((7, 3)), np.zeros((7, 2))).shape, (7, 2))

    def test_actions_lie_within_their_bounds_where_there_are_some(self):
        policy = self.load(policy_file(actor([0.5, -0.5]), interface=GYM))
        np.testing.assert_allclose(policy([0, 1, 2], [3, 4]), [2.25, 3.5], atol=1e-6)

    def test_actors_read_how_far_contacts_are_apart(self):
        weights = actor([0, 0])
        weights["layer0.weight"] = np.zeros((17, 4), "<f4")
        # The second scale of the contact follows the state and its Fourier features.
        weights["layer0.weight"][8, 0] = weights["output.weight"][1, 0] = 1
        contact = {"other": 0, "goal": 2, "slope": 2.0, "offset": 0.5, "width": 0.25}
        policy = self.load(policy_file(weights, contact))
        apart = (5.75 - 2 * 2.5 - 0.5) / 0.25
        expected = [0, np.tanh(np.tanh(apart / 2))]
        np.testing.assert_allclose(policy([5.75, 1, 2.5], [3, 4]), expected, atol=1e-6)

    def test_observations_become_states_and_goals(self):
        plain = self.load(policy_file(actor([0, 0])))
        seen = {"observation": [1, 2, 3], "achieved_goal": [2, 3], "desired_goal": [5, 6]}
        np.testing.assert_array_equal(plain.state(seen), [1, 2, 3])
        np.testing.assert_array_equal(plain.goal(seen), [5, 6])
        # What is achieved is not part of the observation, and comes second.
        apart = {**GYM, "observation": 1, "state_columns": [0, 2, 1], "goal_columns": [1, 0]}
        policy = self.load(policy_file(actor([0, 0]), interface=apart))
        seen["observation"] = [1]
        np.testing.assert_array_equal(policy.state(seen), [1, 3, 2])
        np.testing.assert_array_equal(policy.goal(seen), [6, 5])
        # OGBench: a vector, and the goal in info, of which only a part has to be achieved.
        tasks = {**GYM, "achieved_goal": 0, "desired_goal": 3, "goal_columns": [1, 2]}
        policy = self.load(policy_file(actor([0, 0]), interface=tasks))
        np.testing.assert_array_equal(policy.state(np.array([1, 2, 3])), [1, 2, 3])
        np.testing.assert_array_equal(policy.goal(np.zeros(3), {"goal": [7, 8, 9]}), [8, 9])

    def test_goals_are_reached_within_their_radius(self):
        policy = self.load(policy_file(actor([0, 0]), goal_radius=0.5))
        self.assertTrue(policy.reached([9, 1, 2], [1.4, 2]))
        self.assertFalse(policy.reached([9, 1, 2], [1.5, 2]))
        np.testing.assert_array_equal(
            policy.reached([[9, 1, 2], [9, 3, 2]], [[1, 2], [1, 2]]), [True, False]
        )

    def test_files_that_are_no_policies_are_refused(self):
        whole = policy_file(actor([0, 0]))
        other = json.dumps({"__metadata__": {"format": "checkpoint"}}).encode()
        lacking = actor([0, 0])
        del lacking["layer0.bias"]
        for data, problem in [
            (b"", "no safetensors file"),
            (b"not a policy at all", "no safetensors file"),
            (whole[:40], "cut off"),
            (whole[:-3], "cut off"),
            (len(other).to_bytes(8, "little") + other, "gdg-tui export-policy"),
            (len(b"[]").to_bytes(8, "little") + b"[]", "not an exported policy"),
            (policy_file(lacking), "layer0.bias"),
            (policy_file(actor([0, 0]), plans={}), "rules|plans"),
        ]:
            with self.assertRaisesRegex(gdg_tui.PolicyError, problem):
                self.load(data)
        with self.assertRaises(FileNotFoundError):
            gdg_tui.load_policy("no-such-file")

    def test_what_does_not_fit_is_said(self):
        policy = self.load(policy_file(actor([0, 0]), interface=GYM))
        for call, problem in [
            (lambda: policy([1, 2], [3, 4]), r"a state has 3 numbers.*\(2,\)"),
            (lambda: policy([1, 2, 3], [3]), "a goal has 2 numbers"),
            (lambda: policy(np.zeros((4, 3)), np.zeros((3, 2))), "4 states, but 3 goals"),
            (lambda: policy.state([1, 2, 3]), "an observation has 5 numbers"),
            (lambda: policy.goal([1, 2, 3]), "there is no goal"),
            (lambda: policy.walk([1, 2]), "--plans"),
            (lambda: policy.distance([1, 2, 3], [1, 2]), "--plans"),
            (lambda: policy.reached([1, 2, 3], [1, 2]), "export it again"),
        ]:
            with self.assertRaisesRegex(ValueError, problem):
                call()


# In place of a service: says what is done, and fails at the step 3.
SERVICE = """
class Run:
    def log(self, values, step):
        if step == 3:
            raise RuntimeError("no space left")
        print("log", step)
    def finish(self):
        print("finish")
Image = None
def init(**how):
    print("init")
    return Run()
"""


class Logged(unittest.TestCase):
    def log(self, *steps, mark=""):
        """Logs a start for each 0, and progress for others; returns status, output, and errors."""
        event = lambda step: {"event": "progress" if step else "start", "updates": step}
        lines = mark + "".join(json.dumps(event(step)) + "\n" for step in steps)
        with tempfile.TemporaryDirectory() as folder:
            pathlib.Path(folder, "wandb.py").write_text(SERVICE)
            read, write = os.pipe()
            os.set_inheritable(write, False)
            path = os.pathsep.join([folder, *sys.path])
            command = [sys.executable, "-m", "gdg_tui.log", "--to", "wandb"]
            how = {"stdin": read, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
            with subprocess.Popen(command, env={**os.environ, "PYTHONPATH": path}, **how) as logger:
                os.close(read)
                with os.fdopen(write, "wb") as records:
                    # More than a pipe holds: it fails if nobody reads it.
                    records.write(lines.encode() + 9_000 * b'{"event":"saved"}\n')
                output, errors = logger.communicate()
        return logger.returncode, output.split("\n")[:-1], errors

    def test_runs_are_closed_where_the_next_one_starts(self):
        status, output, _ = self.log(0, 1, 0, 2, mark="\ufeff")
        self.assertEqual((status, output), (0, ["init", "log 1", "finish", "init", "log 2", "finish"]))

    def test_a_failure_is_said_once_and_records_are_read_to_their_end(self):
        status, output, errors = self.log(0, 1, 3, 3)
        self.assertEqual((status, output), (1, ["init", "log 1"]))
        self.assertEqual(errors.count("no space left"), 1)
        self.assertNotIn("Traceback", errors)

    def test_nothing_logged_is_a_failure(self):
        self.assertEqual(self.log(1)[:2], (1, []))


if __name__ == "__main__":
    unittest.main()
