//! A run's policy as a safetensors file that other programs read.

use std::collections::HashMap;

use safetensors::Dtype;
use safetensors::tensor::TensorView;
use serde_json::{Value, json};

use super::error::TrainError;
use super::trainer::Trainer;
use crate::bridge::{BridgeGraph, Edge};
use crate::env::Recorded;
use crate::job::Job;
use crate::learn::{LearnError, NamedTensor};
use crate::store::StoreError;

/// Name of the description in the file's metadata.
pub(super) const POLICY_KEY: &str = "policy";

struct Array {
    name: String,
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

impl Array {
    fn f32(name: impl Into<String>, shape: &[usize], values: &[f32]) -> Self {
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        Self { name: name.into(), dtype: Dtype::F32, shape: shape.to_vec(), bytes }
    }

    fn u32(name: &str, values: impl ExactSizeIterator<Item = u32>) -> Self {
        let (name, shape) = (name.to_owned(), vec![values.len()]);
        Self { name, dtype: Dtype::U32, shape, bytes: values.flat_map(u32::to_le_bytes).collect() }
    }
}

impl From<&NamedTensor> for Array {
    fn from(tensor: &NamedTensor) -> Self {
        Self::f32(&tensor.name, &tensor.shape, &tensor.values)
    }
}

/// Returns the bytes of a safetensors file with the actor that evaluations use: its weights by
/// name, and in the metadata, as JSON under `policy`, how its inputs are computed (see
/// [`crate::learn::ActorExport`]), and how observations and actions of an environment in Python
/// become its own.
///
/// If `with_plans`, it also has what planned evaluations use: critics and model (see
/// [`crate::learn::CriticsExport`]), the bridge candidates with the paths observed between them, and
/// the edges of their graph; says how far that is, as one stage of `progress`.
pub fn policy_file(
    trainer: &Trainer,
    with_plans: bool,
    progress: &Job,
) -> Result<Vec<u8>, TrainError> {
    let run = trainer.run();
    let export = trainer.learner().export_actor(run.settings.bridge.averaged_weights)?;
    let export = export.ok_or_else(|| not_exported(trainer, "the actor"))?;
    let mut arrays: Vec<Array> = export.tensors.iter().map(Array::from).collect();
    let mut description = json!({
        "inputs": export.inputs,
        "goal_radius": trainer.spec().goal_radius,
        "world": trainer.world().kind(),
        "method": run.method.name(),
        "seed": run.seed,
        "updates": trainer.counters().updates,
    });
    if let Some(interface) = trainer.world().abilities().recorded.and_then(Recorded::interface) {
        description["interface"] = interface;
    }
    if with_plans {
        let (plans, more) = plans(trainer, progress)?;
        description["plans"] = plans;
        arrays.extend(more);
    }
    serialize(&description, &arrays)
}

fn serialize(description: &Value, arrays: &[Array]) -> Result<Vec<u8>, TrainError> {
    let failed = |error: safetensors::SafeTensorError| StoreError::inconsistent(error.to_string());
    let views = arrays.iter().map(|Array { name, dtype, shape, bytes }| {
        TensorView::new(*dtype, shape.clone(), bytes).map(|view| (name.as_str(), view))
    });
    let views = views.collect::<Result<Vec<_>, _>>().map_err(failed)?;
    let metadata = HashMap::from([(POLICY_KEY.to_owned(), description.to_string())]);
    Ok(safetensors::serialize(views, Some(metadata)).map_err(failed)?)
}

fn not_exported(trainer: &Trainer, what: &str) -> LearnError {
    let kind = trainer.learner().kind();
    LearnError::Other(format!("{what} of the learner {kind} cannot be exported yet").into())
}

/// Returns the description and the arrays of what planned evaluations use besides the actor.
fn plans(trainer: &Trainer, progress: &Job) -> Result<(Value, Vec<Array>), TrainError> {
    let method = &trainer.run().method;
    let Some(graph) = trainer.evaluation()?.graph(progress) else {
        let problem = format!("the method {method} does not plan: there are no plans to export");
        return Err(LearnError::Other(problem.into()).into());
    };
    let averaged = trainer.run().settings.bridge.averaged_weights;
    let critics = trainer.learner().export_critics(averaged)?;
    let critics = critics.ok_or_else(|| not_exported(trainer, "the critic"))?;
    let mut arrays: Vec<Array> = critics.tensors.iter().map(Array::from).collect();
    arrays.extend(graph_arrays(&graph, trainer.spec().state_dim()));
    Ok((json!({ "rules": graph.rules(), "critics": critics.outputs }), arrays))
}

/// Returns the candidates of a graph, the paths observed between them, how often hops arrived, and
/// the edges.
fn graph_arrays(graph: &BridgeGraph, state_dim: usize) -> [Array; 9] {
    let (hops, edges) = (graph.candidates().hops().counts(), graph.edges());
    let (mut paths, mut ends) = (Vec::new(), Vec::new());
    for from in 0..graph.candidates().len() {
        let observed = graph.candidates().observed_from(from);
        paths.extend(observed.map(|(to, steps)| (to as u32, u32::from(steps))));
        ends.push(paths.len() as u32);
    }
    let shape = [graph.candidates().len(), state_dim];
    let lengths = |length: fn(&Edge) -> f32| edges.iter().map(length).collect();
    let (distances, costs): (Vec<f32>, Vec<f32>) = (lengths(|e| e.distance), lengths(|e| e.cost));
    [
        Array::f32("candidates", &shape, graph.candidates().states()),
        Array::u32("observed.ends", ends.into_iter()),
        Array::u32("observed.to", paths.iter().map(|(to, _)| *to)),
        Array::u32("observed.steps", paths.iter().map(|(_, steps)| *steps)),
        Array::f32("hops", &[hops.len(), 2], hops.as_flattened()),
        Array::u32("edges.from", edges.iter().map(|edge| edge.from as u32)),
        Array::u32("edges.to", edges.iter().map(|edge| edge.to as u32)),
        Array::f32("edges.distance", &[edges.len()], &distances),
        Array::f32("edges.cost", &[edges.len()], &costs),
    ]
}
