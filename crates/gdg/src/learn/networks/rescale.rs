//! Networks in other scales: what training has seen more of than a first look has wider ranges.

use std::ops::Range;

use crate::env::{MOST_HALF_RANGES, Spec};
use crate::learn::networks::mlp::Mlp;
use crate::store::Store;

/// What a checkpoint has of a network's flat parameters: themselves, their average, and Adam's moments
/// with the power of the inputs' scale that each is in.
const PARAMETERS: [&str; 2] = ["dense", "dense_average"];
const MOMENTS: [(&str, i32); 2] = [("dense_m", 1), ("dense_v", 2)];

/// Rewrites the saved network `name`, whose inputs begin with a state, from the scales of `before` to
/// those of `now`: with the inputs `u = (s - c) / h` of old and `u' = (s - c') / h'` of new ones,
/// `w u + b = w (h' / h) u' + b + w (c' - c) / h`. Outputs are the same but where inputs were cut at
/// [`MOST_HALF_RANGES`].
pub fn inputs(store: &mut Store, name: &str, mlp: Mlp, [before, now]: [&Spec; 2]) {
    for i in 0..before.state_dim() {
        let [old, new] = [before, now].map(|spec| spec.state_half_range[i]);
        if old <= 0.0 || (old, before.state_centre[i]) == (new, now.state_centre[i]) {
            continue;
        }
        let most = |v: f32| v.clamp(-MOST_HALF_RANGES, MOST_HALF_RANGES);
        let stretch = most(new / old);
        let shift = most((now.state_centre[i] - before.state_centre[i]) / old);
        let weights = i * mlp.hidden..(i + 1) * mlp.hidden;
        for part in PARAMETERS {
            change(store, name, part, |numbers| {
                let (all, bias) = numbers[..mlp.bias(0).end].split_at_mut(mlp.bias(0).start);
                for (w, b) in all[weights.clone()].iter_mut().zip(bias) {
                    *b += shift * *w;
                    *w *= stretch;
                }
            });
        }
        for (part, power) in MOMENTS {
            let by = stretch.powi(-power);
            change(store, name, part, |numbers| {
                numbers[weights.clone()].iter_mut().for_each(|v| *v *= by);
            });
        }
    }
}

/// Adds the inputs `columns`, of contacts that have been found since, to the saved network `name`,
/// which has not read them so far: outputs are the same.
pub fn widen(store: &mut Store, name: &str, mlp: Mlp, columns: Range<usize>) {
    for part in PARAMETERS.into_iter().chain(MOMENTS.map(|(part, _)| part)) {
        change(store, name, part, |numbers| {
            let at = columns.start * mlp.hidden;
            numbers.splice(at..at, vec![0.0; columns.len() * mlp.hidden]);
        });
    }
}

/// Rewrites the outputs of the saved dynamics model `name`, changes of state components in units of
/// their typical ones. Its gradients change in size, so Adam starts over.
pub fn outputs(store: &mut Store, name: &str, mlp: Mlp, [before, now]: [&Spec; 2]) {
    if before.change_scale == now.change_scale {
        return;
    }
    for (i, (old, new)) in before.change_scale.iter().zip(&now.change_scale).enumerate() {
        let by = if *old > 0.0 { old / new } else { 1.0 };
        change(store, name, PARAMETERS[0], |numbers| {
            let weights = &mut numbers[mlp.output_weights()][i * mlp.hidden..(i + 1) * mlp.hidden];
            weights.iter_mut().for_each(|w| *w *= by);
            numbers[mlp.output_bias()][i] *= by;
        });
    }
    for (part, _) in MOMENTS {
        change(store, name, part, |numbers| numbers.fill(0.0));
    }
}

/// Changes a part of a saved network, if it has it.
fn change(store: &mut Store, name: &str, part: &str, change: impl FnOnce(&mut Vec<f32>)) {
    let name = format!("{name}.{part}");
    if let Ok(numbers) = store.numbers(&name) {
        let mut numbers = numbers.to_vec();
        change(&mut numbers);
        store.put_numbers(name, numbers);
    }
}
