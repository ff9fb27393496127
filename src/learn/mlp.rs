//! A multilayer perceptron on flat parameters, forward and backward by hand.

use std::ops::Range;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::kernel;
use super::product::{Left, Panels};

/// Sizes of a perceptron: ReLU hidden layers of equal width and a linear output layer.
///
/// Its parameters are one flat vector: for each hidden layer the weights `(inputs, hidden)` row-major and the
/// biases, then the output weights `(outputs, hidden)` and the output biases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mlp {
    pub inputs: usize,
    pub hidden: usize,
    pub layers: usize,
    pub outputs: usize,
}

/// Hidden outputs of one forward pass and room for its backward pass; grows to the largest batch seen.
#[derive(Clone, Debug, Default)]
pub struct Activations {
    /// One `(rows, hidden)` block per layer.
    hidden: Vec<Vec<f32>>,
    d_hidden: [Vec<f32>; 2],
    /// The gradient behind a layer as the right-hand side of its weights' gradient.
    packed: Panels,
}

/// A perceptron's hidden weights in the forms that products want them in; to be packed anew after each change.
#[derive(Clone, Debug, Default)]
pub struct Packed {
    /// Of each hidden layer `(inputs of the layer, hidden)`, for the way forward.
    forward: Vec<Panels>,
    /// Their transposes, for the way back; empty where no gradient flows.
    backward: Vec<Panels>,
}

/// Which gradients a backward pass computes: what nobody reads costs nothing.
pub struct Wanted<'a> {
    /// Gradient of the flat parameters, overwritten.
    pub parameters: Option<&'a mut [f32]>,
    /// Gradient of the input columns from `.0` on, `(rows, inputs - .0)`, overwritten.
    pub inputs: Option<(usize, &'a mut [f32])>,
}

impl Mlp {
    /// Length of the flat parameter vector.
    pub fn parameters(&self) -> usize {
        self.output_bias().end
    }

    /// Weights of hidden layer `layer`, `(inputs of the layer, hidden)`.
    pub fn weights(&self, layer: usize) -> Range<usize> {
        let first = (self.inputs + 1) * self.hidden;
        let start = if layer == 0 { 0 } else { first + (layer - 1) * (self.hidden + 1) * self.hidden };
        start..start + self.layer_inputs(layer) * self.hidden
    }

    /// Biases of hidden layer `layer`.
    pub fn bias(&self, layer: usize) -> Range<usize> {
        let end = self.weights(layer).end;
        end..end + self.hidden
    }

    /// Weights of the output layer, `(outputs, hidden)`.
    pub fn output_weights(&self) -> Range<usize> {
        let start = self.bias(self.layers - 1).end;
        start..start + self.outputs * self.hidden
    }

    /// Biases of the output layer.
    pub fn output_bias(&self) -> Range<usize> {
        let end = self.output_weights().end;
        end..end + self.outputs
    }

    /// Inputs of hidden layer `layer`.
    pub fn layer_inputs(&self, layer: usize) -> usize {
        if layer == 0 { self.inputs } else { self.hidden }
    }

    /// Fresh parameters, uniform in +-1/sqrt(inputs of the layer).
    pub fn initial(&self, rng: &mut ChaCha8Rng) -> Vec<f32> {
        let mut parameters = vec![0.0; self.parameters()];
        let mut fill = |range: Range<usize>, inputs: usize| {
            let bound = 1.0 / (inputs as f32).sqrt();
            parameters[range].fill_with(|| rng.random_range(-bound..bound));
        };
        for layer in 0..self.layers {
            fill(self.weights(layer), self.layer_inputs(layer));
            fill(self.bias(layer), self.layer_inputs(layer));
        }
        fill(self.output_weights(), self.hidden);
        fill(self.output_bias(), self.hidden);
        parameters
    }

    /// Packs the hidden weights of `parameters`, for the way back too if `gradients` are wanted.
    pub fn pack(&self, parameters: &[f32], gradients: bool, packed: &mut Packed) {
        packed.forward.resize_with(self.layers, Panels::default);
        packed.backward.resize_with(if gradients { self.layers } else { 0 }, Panels::default);
        for (layer, panels) in packed.forward.iter_mut().enumerate() {
            panels.pack(&parameters[self.weights(layer)], self.layer_inputs(layer), self.hidden);
        }
        for (layer, panels) in packed.backward.iter_mut().enumerate() {
            panels.pack_transposed(&parameters[self.weights(layer)], self.hidden, self.layer_inputs(layer));
        }
    }

    /// `y = mlp(x)` with `x` `(rows, inputs)` and `y` `(rows, outputs)`; `parameters` as they are and packed.
    pub fn forward(&self, (parameters, packed): (&[f32], &Packed), x: &[f32], y: &mut [f32], acts: &mut Activations) {
        let rows = x.len() / self.inputs;
        acts.hidden.resize_with(self.layers, Vec::new);
        for layer in 0..self.layers {
            let (before, rest) = acts.hidden.split_at_mut(layer);
            let input = before.last().map_or(x, |h| &h[..rows * self.hidden]);
            let out = &mut rest[0];
            out.resize(out.len().max(rows * self.hidden), 0.0);
            let out = &mut out[..rows * self.hidden];
            packed.forward[layer].relu_layer(Left::Rows(input), rows, &parameters[self.bias(layer)], out);
        }
        let last = &acts.hidden[self.layers - 1][..rows * self.hidden];
        let (w, b) = (&parameters[self.output_weights()], &parameters[self.output_bias()]);
        kernel::thin_forward(last, w, b, &mut y[..rows * self.outputs]);
    }

    /// Gradients of the pass that `acts` holds, from `dy` `(rows, outputs)`.
    pub fn backward(
        &self,
        (parameters, packed): (&[f32], &Packed),
        x: &[f32],
        dy: &[f32],
        acts: &mut Activations,
        wanted: Wanted,
    ) {
        let rows = dy.len() / self.outputs;
        let size = rows * self.hidden;
        let Wanted { parameters: mut gradient, inputs } = wanted;
        let [mut d, mut d_below] = std::mem::take(&mut acts.d_hidden);
        d.resize(d.len().max(size), 0.0);
        d_below.resize(d_below.len().max(size), 0.0);
        let last = &acts.hidden[self.layers - 1][..size];
        if let Some(gradient) = gradient.as_deref_mut() {
            let (dw, db) = gradient[self.output_weights().start..].split_at_mut(self.outputs * self.hidden);
            kernel::thin_backward_weights(dy, last, dw, db);
        }
        kernel::thin_backward_input(dy, &parameters[self.output_weights()], self.outputs, &mut d[..size]);
        for layer in (0..self.layers).rev() {
            kernel::relu_backward(&mut d[..size], &acts.hidden[layer][..size]);
            let width = self.layer_inputs(layer);
            if let Some(gradient) = gradient.as_deref_mut() {
                let input = if layer == 0 { x } else { &acts.hidden[layer - 1][..size] };
                acts.packed.pack(&d[..size], rows, self.hidden);
                acts.packed.product(Left::Columns(input), width, 0, &mut gradient[self.weights(layer)]);
                kernel::column_sums(&d[..size], &mut gradient[self.bias(layer)]);
            }
            if layer > 0 {
                packed.backward[layer].product(Left::Rows(&d[..size]), rows, 0, &mut d_below[..size]);
                std::mem::swap(&mut d, &mut d_below);
            }
        }
        if let Some((from, dx)) = inputs {
            let columns = self.inputs - from;
            if columns <= 4 {
                let weights = &parameters[self.weights(0)][from * self.hidden..];
                kernel::thin_forward(&d[..size], weights, &[0.0; 4][..columns], &mut dx[..rows * columns]);
            } else {
                packed.backward[0].product(Left::Rows(&d[..size]), rows, from, &mut dx[..rows * columns]);
            }
        }
        acts.d_hidden = [d, d_below];
    }
}
