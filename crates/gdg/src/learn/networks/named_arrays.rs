//! Networks as named arrays and a description of their inputs, for other programs.

use candle_core::Result;
use serde::Serialize;

use crate::env::Contact;
use crate::learn::networks::encoder::{CONTACT_SCALES, Encoder};
use crate::learn::networks::grid_encoding::CHANNELS;
use crate::learn::networks::lookahead::{GOOD_PROGRESS_STEPS, MIN_GAIN_STEPS};
use crate::learn::networks::mlp::Mlp;
use crate::learn::networks::network::Network;
use crate::learn::networks::shapes::Shapes;

/// An actor that other programs can run.
///
/// With `u` the state scaled to [-1, 1], `u_a` its achieved goal, `w` the scaled goal and all
/// arrays by rows, the actor's input is
///
/// ```text
/// x = [u | F(u_a) | C(s) | w | F(w) | tanh(rate * (goal - achieved)) for each rate | G(u_a) | G(w)]
/// ```
///
/// where `C(s)` is `tanh(apart / (width * c))` for each contact and each of its scales c, with `apart =
/// state[other] - slope * state[goal] - offset`, `F(p)` is `sin(pi p), cos(pi p), sin(2 pi p), cos(2 pi
/// p), ...`, `fourier_octaves` pairs for each component, the relative inputs list all rates of one component before the next, and `G`
/// reads the grids, if there are any. Then `x = max(0, x @ layerI.weight + layerI.bias)` for each
/// layer, and the action is `tanh(output.weight @ x + output.bias)`. The Python module `gdg_tui` does
/// this in numpy.
#[derive(Clone, Debug)]
pub struct ActorExport {
    /// The weights, in order.
    pub tensors: Vec<NamedTensor>,
    pub inputs: ActorInputs,
}

/// Critics and the dynamics model, for other programs that plan and look ahead.
///
/// Critic k is named `criticK.` and has the inputs of the actor; with z its output, its D is
/// `distance_scale * ln(1 + exp(z))`. D of two critics is `max(a, b) - (1 - pessimism) / 2 * |a -
/// b|`. The input of `model.` is `[u | F(u_a) | C(s) | G(u_a) | action]`; with z its output, the next
/// state is `state + change_scale * z`.
#[derive(Clone, Debug)]
pub struct CriticsExport {
    /// The weights, each network's named as the actor's after the network's own name.
    pub tensors: Vec<NamedTensor>,
    pub outputs: CriticOutputs,
}

/// What the outputs of critics and model mean, and how lookahead uses them.
#[derive(Clone, Debug, Serialize)]
pub struct CriticOutputs {
    pub critics: usize,
    /// Steps of D at an output of 1, about.
    pub distance_scale: f32,
    /// Weight of the largest distance of several critics; the rest is their mean.
    pub pessimism: f32,
    /// See [`crate::env::Spec::change_scale`].
    pub change_scale: Vec<f32>,
    /// Actions that lookahead tries besides the actor's, each `(action_dim)`; none where the model is
    /// not exact enough.
    pub tried_actions: Vec<Vec<f32>>,
    /// Progress by D of an action in steps from which no other is tried.
    pub good_progress_steps: f32,
    /// Gain by D over the actor's action in steps from which another one is taken.
    pub min_gain_steps: f32,
}

#[derive(Clone, Debug)]
pub struct NamedTensor {
    /// `layerI.weight` (inputs, hidden) and `layerI.bias` (hidden), `output.weight` (action_dim,
    /// hidden) and `output.bias` (action_dim), and `gridI` (corners of the last axis, ..., corners
    /// of the first axis, channels).
    pub name: String,
    pub shape: Vec<usize>,
    /// Its values, row-major.
    pub values: Vec<f32>,
}

/// How an actor's inputs are computed.
#[derive(Clone, Debug, Serialize)]
pub struct ActorInputs {
    /// See [`crate::env::Spec::state_centre`].
    pub state_centre: Vec<f32>,
    /// See [`crate::env::Spec::state_half_range`]; a component whose range is 0 is scaled to 0, and
    /// any other to 10 half ranges at most.
    pub state_half_range: Vec<f32>,
    /// State components that form the achieved goal. Goals are scaled like these.
    pub achieved: Vec<usize>,
    /// Octaves of the Fourier features of each component.
    pub fourier_octaves: usize,
    /// Rates of the relative inputs, in 1 / length.
    pub relative_rates: Vec<f32>,
    /// See [`crate::env::Spec::contacts`].
    pub contacts: Vec<Contact>,
    /// Scales of what networks read of a contact, in its widths.
    pub contact_scales: [f32; 3],
    /// Hidden layers (ReLU).
    pub layers: usize,
    /// Grids: each spans [-1, 1] along every axis and is read by multilinear interpolation;
    /// positions outside are moved to its edge.
    pub grids: usize,
}

impl ActorExport {
    /// Returns the export of `actor`, or of its running average.
    pub(in crate::learn) fn of(shapes: &Shapes, actor: &Network, averaged: bool) -> Result<Self> {
        let Encoder { spec, octaves, relative, grid } = &shapes.encoder;
        let inputs = ActorInputs {
            state_centre: spec.state_centre.clone(),
            state_half_range: spec.state_half_range.clone(),
            achieved: spec.achieved.clone(),
            fourier_octaves: *octaves,
            relative_rates: relative.clone(),
            contacts: spec.contacts.clone(),
            contact_scales: CONTACT_SCALES,
            layers: shapes.actor.layers,
            grids: grid.as_ref().map_or(0, |grid| grid.levels.len()),
        };
        let mut all = Vec::new();
        add_tensors("", &shapes.encoder, &shapes.actor, &actor.copy(averaged)?, &mut all);
        Ok(Self { tensors: all, inputs })
    }
}

impl CriticsExport {
    /// Returns the export of `critics` and `model`, or of their running averages.
    pub(in crate::learn) fn of<'a>(
        shapes: &Shapes,
        critics: impl Iterator<Item = &'a Network>,
        model: &Network,
        averaged: bool,
    ) -> Result<Self> {
        let (mut all, encoder) = (Vec::new(), &shapes.encoder);
        for (k, critic) in critics.enumerate() {
            let (name, weights) = (format!("critic{k}."), critic.copy(averaged)?);
            add_tensors(&name, encoder, &shapes.critic, &weights, &mut all);
        }
        add_tensors("model.", encoder, &shapes.model, &model.copy(averaged)?, &mut all);
        let tried = shapes.tried_actions.chunks(encoder.spec.action_dim);
        let outputs = CriticOutputs {
            critics: shapes.critics,
            distance_scale: shapes.distance_scale,
            pessimism: shapes.pessimism,
            change_scale: encoder.spec.change_scale.clone(),
            tried_actions: tried.map(<[_]>::to_vec).collect(),
            good_progress_steps: GOOD_PROGRESS_STEPS,
            min_gain_steps: MIN_GAIN_STEPS,
        };
        Ok(Self { tensors: all, outputs })
    }
}

/// Adds the arrays of a network `mlp` with these parameters and grid table `(corners, channels)`,
/// their names beginning with `prefix`.
fn add_tensors(
    prefix: &str,
    encoder: &Encoder,
    mlp: &Mlp,
    (parameters, table): &(Vec<f32>, Option<Vec<f32>>),
    tensors: &mut Vec<NamedTensor>,
) {
    let mut add = |name: String, shape: &[usize], values: &[f32]| {
        let (name, shape, values) = (format!("{prefix}{name}"), shape.to_vec(), values.to_vec());
        tensors.push(NamedTensor { name, shape, values });
    };
    for layer in 0..mlp.layers {
        let shape = [mlp.layer_inputs(layer), mlp.hidden];
        add(format!("layer{layer}.weight"), &shape, &parameters[mlp.weights(layer)]);
        add(format!("layer{layer}.bias"), &[mlp.hidden], &parameters[mlp.bias(layer)]);
    }
    let shape = [mlp.outputs, mlp.hidden];
    add("output.weight".to_owned(), &shape, &parameters[mlp.output_weights()]);
    add("output.bias".to_owned(), &[mlp.outputs], &parameters[mlp.output_bias()]);
    if let (Some(grid), Some(table)) = (&encoder.grid, table) {
        for (i, level) in grid.levels.iter().enumerate() {
            let mut shape = vec![level.corners; grid.dims];
            shape.push(CHANNELS);
            let values = &table[level.first * CHANNELS..][..shape.iter().product()];
            add(format!("grid{i}"), &shape, values);
        }
    }
}
