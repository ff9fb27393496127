//! A multilayer perceptron on flat parameters, with hand-written forward and backward passes.

use std::ops::Range;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::learn::kernels::kernel;
use crate::learn::kernels::product::{Lhs, Panels};

/// Sizes of an MLP: ReLU hidden layers of equal width and a linear output layer.
///
/// Its parameters are one flat vector: for each hidden layer the weights `(inputs, hidden)`
/// row-major and the biases, then the output weights `(outputs, hidden)` and the output biases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mlp {
    pub inputs: usize,
    pub hidden: usize,
    pub layers: usize,
    pub outputs: usize,
}

/// Hidden activations of one forward pass and buffers for its backward pass; grows to the largest
/// batch seen.
#[derive(Clone, Debug, Default)]
pub struct Activations {
    /// One `(rows, hidden)` block per layer.
    hidden: Vec<Vec<f32>>,
    d_hidden: [Vec<f32>; 2],
    /// A layer's output gradient, packed as the right-hand side of the product for its weight
    /// gradient.
    packed: Panels,
}

/// An MLP's hidden weights, packed for matrix products; must be repacked after each change.
#[derive(Clone, Debug, Default)]
pub struct Packed {
    /// Weights of each hidden layer `(inputs of the layer, hidden)`, for the forward pass.
    forward: Vec<Panels>,
    /// Their transposes, for the backward pass; empty if no gradients are needed.
    backward: Vec<Panels>,
}

/// Which gradients a backward pass computes; the others are skipped.
pub struct GradientRequest<'a> {
    /// Gradient of the flat parameters, overwritten.
    pub parameters: Option<&'a mut [f32]>,
    /// Gradient of the input columns from `.0` on, `(rows, inputs - .0)`, overwritten.
    pub inputs: Option<(usize, &'a mut [f32])>,
}

impl Mlp {
    pub fn parameters(&self) -> usize {
        self.output_bias().end
    }

    /// Returns the range of hidden layer `layer`'s weights, `(inputs of the layer, hidden)`.
    pub fn weights(&self, layer: usize) -> Range<usize> {
        let first = (self.inputs + 1) * self.hidden;
        let start =
            if layer == 0 { 0 } else { first + (layer - 1) * (self.hidden + 1) * self.hidden };
        start..start + self.layer_inputs(layer) * self.hidden
    }

    pub fn bias(&self, layer: usize) -> Range<usize> {
        let end = self.weights(layer).end;
        end..end + self.hidden
    }

    /// Returns the range of the output layer's weights, `(outputs, hidden)`.
    pub fn output_weights(&self) -> Range<usize> {
        let start = self.bias(self.layers - 1).end;
        start..start + self.outputs * self.hidden
    }

    pub fn output_bias(&self) -> Range<usize> {
        let end = self.output_weights().end;
        end..end + self.outputs
    }

    pub fn layer_inputs(&self, layer: usize) -> usize {
        if layer == 0 { self.inputs } else { self.hidden }
    }

    /// Draws initial parameters, uniform in +-1/sqrt(inputs of the layer).
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

    /// Packs the hidden weights of `parameters`, also for the backward pass if `gradients`.
    pub fn pack(&self, parameters: &[f32], gradients: bool, packed: &mut Packed) {
        packed.forward.resize_with(self.layers, Panels::default);
        packed.backward.resize_with(if gradients { self.layers } else { 0 }, Panels::default);
        for (layer, panels) in packed.forward.iter_mut().enumerate() {
            panels.pack(&parameters[self.weights(layer)], self.layer_inputs(layer), self.hidden);
        }
        for (layer, panels) in packed.backward.iter_mut().enumerate() {
            panels.pack_transposed(
                &parameters[self.weights(layer)],
                self.hidden,
                self.layer_inputs(layer),
            );
        }
    }

    /// Computes `y = mlp(x)` with `x` `(rows, inputs)` and `y` `(rows, outputs)`; takes the
    /// parameters flat and packed.
    pub fn forward(
        &self,
        parameters: &[f32],
        packed: &Packed,
        x: &[f32],
        y: &mut [f32],
        acts: &mut Activations,
    ) {
        let rows = x.len() / self.inputs;
        acts.hidden.resize_with(self.layers, Vec::new);
        for layer in 0..self.layers {
            let (before, rest) = acts.hidden.split_at_mut(layer);
            let input = before.last().map_or(x, |h| &h[..rows * self.hidden]);
            let out = &mut rest[0];
            out.resize(out.len().max(rows * self.hidden), 0.0);
            let out = &mut out[..rows * self.hidden];
            packed.forward[layer].relu_layer(
                Lhs::Rows(input),
                rows,
                &parameters[self.bias(layer)],
                out,
            );
        }
        let last = &acts.hidden[self.layers - 1][..rows * self.hidden];
        let (w, b) = (&parameters[self.output_weights()], &parameters[self.output_bias()]);
        kernel::thin_forward(last, w, b, &mut y[..rows * self.outputs]);
    }

    /// Computes the gradients of the forward pass held in `acts`, from `dy` `(rows, outputs)`.
    pub fn backward(
        &self,
        parameters: &[f32],
        packed: &Packed,
        x: &[f32],
        dy: &[f32],
        acts: &mut Activations,
        wanted: GradientRequest,
    ) {
        let rows = dy.len() / self.outputs;
        let size = rows * self.hidden;
        let GradientRequest { parameters: mut gradient, inputs } = wanted;
        let [mut d, mut d_below] = std::mem::take(&mut acts.d_hidden);
        d.resize(d.len().max(size), 0.0);
        d_below.resize(d_below.len().max(size), 0.0);
        let last = &acts.hidden[self.layers - 1][..size];
        if let Some(gradient) = gradient.as_deref_mut() {
            let (dw, db) =
                gradient[self.output_weights().start..].split_at_mut(self.outputs * self.hidden);
            kernel::thin_backward_weights(dy, last, dw, db);
        }
        kernel::thin_backward_input(
            dy,
            &parameters[self.output_weights()],
            self.outputs,
            &mut d[..size],
        );
        for layer in (0..self.layers).rev() {
            kernel::relu_backward(&mut d[..size], &acts.hidden[layer][..size]);
            if let Some(gradient) = gradient.as_deref_mut() {
                let input = if layer == 0 { x } else { &acts.hidden[layer - 1][..size] };
                acts.packed.pack(&d[..size], rows, self.hidden);
                let weights = &mut gradient[self.weights(layer)];
                acts.packed.product(Lhs::Columns(input), self.layer_inputs(layer), 0, weights);
                kernel::column_sums(&d[..size], &mut gradient[self.bias(layer)]);
            }
            if layer > 0 {
                packed.backward[layer].product(
                    Lhs::Rows(&d[..size]),
                    rows,
                    0,
                    &mut d_below[..size],
                );
                std::mem::swap(&mut d, &mut d_below);
            }
        }
        if let Some((from, dx)) = inputs {
            let dx = &mut dx[..rows * (self.inputs - from)];
            self.input_gradient(parameters, packed, &d[..size], from, dx);
        }
        acts.d_hidden = [d, d_below];
    }

    /// Computes the gradients `dx` `(rows, inputs - from)` of the last inputs, from those of the
    /// first hidden layer, `d` `(rows, hidden)`.
    fn input_gradient(
        &self,
        parameters: &[f32],
        packed: &Packed,
        d: &[f32],
        from: usize,
        dx: &mut [f32],
    ) {
        let columns = self.inputs - from;
        if columns <= 4 {
            let weights = &parameters[self.weights(0)][from * self.hidden..];
            kernel::thin_forward(d, weights, &[0.0; 4][..columns], dx);
        } else {
            packed.backward[0].product(Lhs::Rows(d), d.len() / self.hidden, from, dx);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learn::reference::{self, Net, wide};
    use crate::learn::tests::assert_gradient;

    /// Returns numbers of both signs that differ between seeds; hardly any unit is at 0, where the
    /// derivative is another one.
    fn numbers(length: usize, seed: usize) -> Vec<f32> {
        (0..length).map(|i| ((i * 31 + seed * 13) % 23) as f32 * 0.0617 - 0.653).collect()
    }

    /// Compares an MLP on `rows` rows, forward and backward, with the inputs' gradient from column
    /// `from` on.
    fn check(mlp: &Mlp, rows: usize, from: usize, acts: &mut Activations, packed: &mut Packed) {
        let [parameters, x, dy] =
            [(mlp.parameters(), 1), (rows * mlp.inputs, 2), (rows * mlp.outputs, 3)]
                .map(|(length, seed)| numbers(length, seed));
        let (mut y, mut gradient) = (vec![f32::NAN; dy.len()], vec![f32::NAN; parameters.len()]);
        let mut dx = vec![f32::NAN; rows * (mlp.inputs - from)];
        mlp.pack(&parameters, true, packed);
        mlp.forward(&parameters, packed, &x, &mut y, acts);
        let wanted =
            GradientRequest { parameters: Some(&mut gradient), inputs: Some((from, &mut dx)) };
        mlp.backward(&parameters, packed, &x, &dy, acts, wanted);

        let label = format!("{mlp:?}, {rows} rows from {from}");
        let outputs = |Net([parameters, x]): &Net| -> Vec<f64> {
            x.chunks_exact(mlp.inputs).flat_map(|x| reference::mlp(mlp, parameters, x)).collect()
        };
        let at = Net([&parameters, &x].map(|part| wide(part)));
        for (found, expected) in y.iter().zip(outputs(&at)) {
            let off = (f64::from(*found) - expected).abs();
            assert!(off < 1e-4 * (1.0 + expected.abs()), "{label}: {found}, not {expected}");
        }
        // As if the last inputs were all: the others have no gradient here.
        let whole = dx.chunks_exact(mlp.inputs - from);
        let whole = whole.flat_map(|dx| [&vec![f32::NAN; from], dx].concat()).collect();
        let loss = |net: &Net| outputs(net).iter().zip(wide(&dy)).map(|(y, dy)| y * dy).sum();
        assert_gradient(&label, &at, &[gradient, whole], loss);
    }

    #[test]
    fn an_mlp_and_its_gradients_match_autograd_at_odd_sizes() {
        // Buffers kept between passes grow, and smaller passes reuse them.
        let (mut acts, mut packed) = (Activations::default(), Packed::default());
        for (hidden, layers) in
            [1, 2, 7, 8, 15, 16, 17, 31, 33, 64, 70].into_iter().zip([1, 2, 3].into_iter().cycle())
        {
            for (inputs, outputs) in [(1, 1), (3, 2), (4, 4), (9, 3), (33, 1)] {
                for (rows, from) in [(1, 0), (5, inputs / 2), (16, inputs - 1), (37, inputs / 3)] {
                    let mlp = Mlp { inputs, hidden, layers, outputs };
                    check(&mlp, rows, from, &mut acts, &mut packed);
                }
            }
        }
    }
}
