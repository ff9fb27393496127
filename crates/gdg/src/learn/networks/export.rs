//! An actor as named arrays and a description of its inputs, for other programs.

use candle_core::Result;
use serde::Serialize;

use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::mlp::Mlp;
use crate::learn::networks::network::Network;

/// An actor that other programs can run.
///
/// With `u` the state scaled to [-1, 1], `u_a` its achieved goal, `w` the scaled goal and all
/// arrays by rows, the actor's input is
///
/// ```text
/// x = [u | F(u_a) | w | F(w) | tanh(rate * (goal - achieved)) for each rate | G(u_a) | G(w)]
/// ```
///
/// where `F(p)` is `sin(pi p), cos(pi p), sin(2 pi p), cos(2 pi p), ...`, `fourier_octaves` pairs
/// for each component, the relative inputs list all rates of one component before the next, and `G`
/// reads the grids, if there are any. Then `x = max(0, x @ layerI.weight + layerI.bias)` for each
/// layer, and the action is `tanh(output.weight @ x + output.bias)`. `tests/policy.py` does this in
/// numpy.
#[derive(Clone, Debug)]
pub struct ActorExport {
    /// The weights, in order.
    pub tensors: Vec<NamedTensor>,
    /// How inputs are computed.
    pub inputs: ActorInputs,
}

/// An array by name.
#[derive(Clone, Debug)]
pub struct NamedTensor {
    /// `layerI.weight` (inputs, hidden) and `layerI.bias` (hidden), `output.weight` (action_dim,
    /// hidden) and `output.bias` (action_dim), and `gridI` (corners of the last axis, ..., corners
    /// of the first axis, channels).
    pub name: String,
    /// Its shape.
    pub shape: Vec<usize>,
    /// Its values, row-major.
    pub values: Vec<f32>,
}

/// How an actor's inputs are computed.
#[derive(Clone, Debug, Serialize)]
pub struct ActorInputs {
    /// See [`crate::env::Spec::state_centre`].
    pub state_centre: Vec<f32>,
    /// See [`crate::env::Spec::state_half_range`]; a component whose range is 0 is scaled to 0.
    pub state_half_range: Vec<f32>,
    /// State components that form the achieved goal. Goals are scaled like these.
    pub achieved: Vec<usize>,
    /// Octaves of the Fourier features of each component.
    pub fourier_octaves: usize,
    /// Rates of the relative inputs, in 1 / length.
    pub relative_rates: Vec<f32>,
    /// Hidden layers (ReLU).
    pub layers: usize,
    /// Grids: each spans [-1, 1] along every axis and is read by multilinear interpolation;
    /// positions outside are moved to its edge.
    pub grids: usize,
}

impl ActorExport {
    /// Returns the export of `actor`, whose shape is `mlp`, or of its running average.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub(in crate::learn) fn of(
        encoder: &Encoder,
        mlp: &Mlp,
        actor: &Network,
        averaged: bool,
    ) -> Result<Self> {
        let (parameters, table) = actor.copy(averaged)?;
        Ok(Self::new(encoder, mlp, &parameters, &table))
    }

    /// Returns the export of an actor `mlp` with these `parameters` and grid `table` `(corners,
    /// channels)`.
    fn new(encoder: &Encoder, mlp: &Mlp, parameters: &[f32], table: &[f32]) -> Self {
        let tensor = |name: String, shape: &[usize], values: &[f32]| NamedTensor {
            name,
            shape: shape.to_vec(),
            values: values.to_vec(),
        };
        let mut tensors = Vec::new();
        for layer in 0..mlp.layers {
            let shape = [mlp.layer_inputs(layer), mlp.hidden];
            tensors.push(tensor(
                format!("layer{layer}.weight"),
                &shape,
                &parameters[mlp.weights(layer)],
            ));
            tensors.push(tensor(
                format!("layer{layer}.bias"),
                &[mlp.hidden],
                &parameters[mlp.bias(layer)],
            ));
        }
        let shape = [mlp.outputs, mlp.hidden];
        tensors.push(tensor("output.weight".to_owned(), &shape, &parameters[mlp.output_weights()]));
        tensors.push(tensor(
            "output.bias".to_owned(),
            &[mlp.outputs],
            &parameters[mlp.output_bias()],
        ));
        let grids = encoder.grid().map_or(0, |grid| {
            for (i, level) in grid.levels.iter().enumerate() {
                let mut shape = vec![level.corners; grid.dims];
                shape.push(grid.channels);
                let first = level.first * grid.channels;
                let values = &table[first..first + shape.iter().product::<usize>()];
                tensors.push(tensor(format!("grid{i}"), &shape, values));
            }
            grid.levels.len()
        });
        let spec = encoder.spec();
        let inputs = ActorInputs {
            state_centre: spec.state_centre.clone(),
            state_half_range: spec.state_half_range.clone(),
            achieved: spec.achieved.clone(),
            fourier_octaves: encoder.octaves(),
            relative_rates: encoder.relative().to_vec(),
            layers: mlp.layers,
            grids,
        };
        Self { tensors, inputs }
    }
}
