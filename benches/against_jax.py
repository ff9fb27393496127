#!/usr/bin/env python3
"""Compares one update of critic, model and actor with the same update in JAX, on one core.

    python3 -m venv venv && venv/bin/pip install jax
    venv/bin/python benches/against_jax.py [--rounds 5]

The update is that of `cargo bench --bench program -- --only updates`: Algorithm 1 of the paper with one critic, two
hidden layers, squared loss, Adam, and averaged weights of the critic. JAX runs many of them in one compiled `lax.scan`, so that nothing but the
update itself is measured. Both take turns; printed are the medians over all turns, in microseconds, and our time as a
share of JAX's, turn by turn.
"""

import argparse
import os
import re
import statistics
import subprocess
import time

# One core for this process and its children, before JAX counts them.
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false"

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402

LEARNING_RATE, BETA1, BETA2, EPSILON = 1e-3, 0.9, 0.999, 1e-8
TAU = 0.005
DISTANCE_SCALE = 40.0
UPDATES = 200
TURNS = 5


def network(key, width, outputs):
    sizes = [(4, width), (width, width), (width, outputs)]
    keys = jax.random.split(key, len(sizes))
    return [(jax.random.normal(k, size) / size[0] ** 0.5, jnp.zeros(size[1])) for k, size in zip(keys, sizes)]


def forward(layers, x):
    for weights, bias in layers[:-1]:
        x = jax.nn.relu(x @ weights + bias)
    weights, bias = layers[-1]
    return x @ weights + bias


def distance(critic, states, goals):
    return DISTANCE_SCALE * jax.nn.softplus(forward(critic, jnp.concatenate([states, goals], 1))[:, 0])


def predicted(model, states, actions):
    return states + forward(model, jnp.concatenate([states, actions], 1))


def adam(parameters, moments, gradient, step):
    first, second = moments
    first = jax.tree.map(lambda m, g: BETA1 * m + (1 - BETA1) * g, first, gradient)
    second = jax.tree.map(lambda v, g: BETA2 * v + (1 - BETA2) * g * g, second, gradient)
    rate = LEARNING_RATE * jnp.sqrt(1 - BETA2**step) / (1 - BETA1**step)
    parameters = jax.tree.map(lambda w, m, v: w - rate * m / (jnp.sqrt(v) + EPSILON), parameters, first, second)
    return parameters, (first, second)


def update(carry, batch):
    (critic, target, model, actor), moments, step = carry
    step = step + 1
    states, goals, ahead, start, actions, following = batch
    targets = 1.0 + distance(target, ahead, goals)
    critic_loss = lambda critic: jnp.mean((distance(critic, states, goals) - targets) ** 2)
    model_loss = lambda model: jnp.mean(jnp.sum((predicted(model, start, actions) - following) ** 2, 1))
    critic, of_critic = adam(critic, moments[0], jax.grad(critic_loss)(critic), step)
    model, of_model = adam(model, moments[1], jax.grad(model_loss)(model), step)

    def actor_loss(actor):
        action = jnp.tanh(forward(actor, jnp.concatenate([states, goals], 1)))
        return jnp.mean(distance(critic, predicted(model, states, action), goals))

    actor, of_actor = adam(actor, moments[2], jax.grad(actor_loss)(actor), step)
    target = jax.tree.map(lambda average, weights: average + TAU * (weights - average), target, critic)
    return ((critic, target, model, actor), (of_critic, of_model, of_actor), step), None


def prepare(rows, width):
    """Returns a function that runs many updates and the time of each, in microseconds."""
    keys = jax.random.split(jax.random.key(1), 10)
    critic, model, actor = (network(key, width, outputs) for key, outputs in zip(keys, (1, 2, 2)))
    zeros = lambda layers: (jax.tree.map(jnp.zeros_like, layers), jax.tree.map(jnp.zeros_like, layers))
    carry = ((critic, critic, model, actor), tuple(map(zeros, (critic, model, actor))), jnp.float32(0))
    positions = lambda key: jax.random.uniform(key, (UPDATES, rows, 2), minval=-1.0, maxval=1.0)
    batches = tuple(positions(key) for key in keys[3:9])
    scan = jax.jit(lambda carry, batches: jax.lax.scan(update, carry, batches)[0])
    state = jax.block_until_ready(scan(carry, batches))

    def turn():
        began = time.perf_counter()
        jax.block_until_ready(scan(state, batches))
        return (time.perf_counter() - began) / UPDATES * 1e6

    return turn


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rounds", type=int, default=5)
    options = options.parse_args()
    command = ["cargo", "bench", "--quiet", "--bench", "program", "--", "--only", "updates", "--threads", "1", "--runs", "5"]
    turns, ours, theirs = {}, {}, {}
    for _ in range(options.rounds):
        table = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        for rows, width, microseconds in re.findall(r"^(\d+) x (\d+) +([\d.]+) us", table, re.MULTILINE):
            shape = int(rows), int(width)
            if shape not in turns:
                turns[shape] = prepare(*shape)
            ours.setdefault(shape, []).append(float(microseconds))
            theirs.setdefault(shape, []).append(statistics.median(turns[shape]() for _ in range(TURNS)))
    print(f"{'update':<12}{'JAX ' + jax.__version__:>14}{'ours':>12}{'ours / JAX':>12}")
    for shape in turns:
        share = statistics.median(a / b for a, b in zip(ours[shape], theirs[shape]))
        times = statistics.median(theirs[shape]), statistics.median(ours[shape])
        print(f"{f'{shape[0]} x {shape[1]}':<12}{times[0]:>11.0f} us{times[1]:>9.0f} us{share:>12.2f}")


if __name__ == "__main__":
    main()
