//! A run's policy as a safetensors file that other programs read.

use std::collections::HashMap;

use candle_core::{Device, Tensor, WithDType};
use serde_json::{Value, json};

use super::Result;
use super::trainer::Trainer;
use crate::bridge::{BridgeGraph, Edge};
use crate::env::Recorded;
use crate::job::Job;
use crate::learn::{LearnError, NamedTensor};
use crate::store::StoreError;

pub(super) const POLICY_KEY: &str = "policy";

type PolicyArrays = Vec<(String, Tensor)>;

fn array<T: WithDType>(
    name: &str,
    shape: &[usize],
    values: &[T],
) -> candle_core::Result<(String, Tensor)> {
    Ok((name.to_owned(), Tensor::from_slice(values, shape, &Device::Cpu)?))
}

fn arrays_of(tensors: &[NamedTensor]) -> candle_core::Result<PolicyArrays> {
    tensors.iter().map(|t| array(&t.name, &t.shape, &t.values)).collect()
}

/// Returns the bytes of a safetensors file with the actor that evaluations use: its weights by
/// name, and in the metadata, as JSON under `policy`, how its inputs are computed (see
/// [`crate::learn::ActorExport`]), and how observations and actions of an environment in Python
/// become its own.
///
/// If `with_plans`, it also has what planned evaluations use: critics and model (see
/// [`crate::learn::CriticsExport`]), the bridge candidates with the paths observed between them, and
/// the edges of their graph; says how far that is, as one stage of `progress`.
pub fn policy_file(trainer: &Trainer, with_plans: bool, progress: &Job) -> Result<Vec<u8>> {
    let run = trainer.run();
    let export = trainer.learner().export_actor(run.settings.bridge.averaged_weights)?;
    let export = export.ok_or_else(|| not_exported(trainer, "the actor"))?;
    let mut arrays = arrays_of(&export.tensors)?;
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
    let metadata = HashMap::from([(POLICY_KEY.to_owned(), description.to_string())]);
    let views = arrays.iter().map(|(name, array)| (name, array));
    let bytes = safetensors::serialize(views, Some(metadata));
    Ok(bytes.map_err(|error| StoreError::inconsistent(error.to_string()))?)
}

fn not_exported(trainer: &Trainer, what: &str) -> LearnError {
    let kind = trainer.learner().kind();
    LearnError::Other(format!("{what} of the learner {kind} cannot be exported yet").into())
}

fn plans(trainer: &Trainer, progress: &Job) -> Result<(Value, PolicyArrays)> {
    let method = &trainer.run().method;
    let Some(graph) = trainer.evaluation()?.graph(progress) else {
        let problem = format!("the method {method} does not plan: there are no plans to export");
        return Err(LearnError::Other(problem.into()).into());
    };
    let averaged = trainer.run().settings.bridge.averaged_weights;
    let critics = trainer.learner().export_critics(averaged)?;
    let critics = critics.ok_or_else(|| not_exported(trainer, "the critic"))?;
    let mut arrays = arrays_of(&critics.tensors)?;
    arrays.extend(graph_arrays(&graph, trainer.spec().state_dim())?);
    Ok((json!({ "rules": graph.rules(), "critics": critics.outputs }), arrays))
}

/// Returns the candidates of a graph, the paths observed between them, how often hops arrived, and
/// the edges.
fn graph_arrays(graph: &BridgeGraph, state_dim: usize) -> candle_core::Result<PolicyArrays> {
    let (hops, edges) = (graph.candidates().hops().counts(), graph.edges());
    let (mut to, mut steps, mut ends) = (Vec::new(), Vec::new(), Vec::new());
    for from in 0..graph.candidates().len() {
        for (candidate, path) in graph.candidates().observed_from(from) {
            to.push(candidate as u32);
            steps.push(u32::from(path));
        }
        ends.push(to.len() as u32);
    }
    let shape = [graph.candidates().len(), state_dim];
    let ids = |name, values: &[u32]| array(name, &[values.len()], values);
    let end = |end: fn(&Edge) -> usize| edges.iter().map(|e| end(e) as u32).collect::<Vec<_>>();
    let lengths = |name, length: fn(&Edge) -> f32| {
        array(name, &[edges.len()], &edges.iter().map(length).collect::<Vec<_>>())
    };
    [
        array("candidates", &shape, graph.candidates().states()),
        ids("observed.ends", &ends),
        ids("observed.to", &to),
        ids("observed.steps", &steps),
        array("hops", &[hops.len(), 2], hops.as_flattened()),
        ids("edges.from", &end(|edge| edge.from)),
        ids("edges.to", &end(|edge| edge.to)),
        lengths("edges.distance", |edge| edge.distance),
        lengths("edges.cost", |edge| edge.cost),
    ]
    .into_iter()
    .collect()
}
