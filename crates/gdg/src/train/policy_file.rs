//! A run's actor as a safetensors file that other programs read.

use std::collections::HashMap;

use safetensors::Dtype;
use safetensors::tensor::TensorView;
use serde_json::json;

use super::error::TrainError;
use super::trainer::Trainer;
use crate::learn::LearnError;
use crate::store::StoreError;

/// Name of the description in the file's metadata.
pub(super) const POLICY_KEY: &str = "policy";

/// Returns the bytes of a safetensors file with the actor that evaluations use: its weights by
/// name, and in the metadata, as JSON under `policy`, how its inputs are computed (see
/// [`crate::learn::ActorExport`]).
///
/// # Errors
/// The learner has no actor to export.
pub fn policy_file(trainer: &Trainer) -> Result<Vec<u8>, TrainError> {
    let run = trainer.run();
    let export = trainer.learner().export_actor(run.settings.bridge.averaged_weights)?;
    let export = export.ok_or_else(|| {
        LearnError::Other(
            format!("the actor of the learner {} cannot be exported yet", trainer.learner().kind())
                .into(),
        )
    })?;
    let description = json!({
        "inputs": export.inputs,
        "world": trainer.world().kind(),
        "method": run.method.name(),
        "seed": run.seed,
        "updates": trainer.counters().updates,
    });
    let failed = |error: safetensors::SafeTensorError| StoreError::inconsistent(error.to_string());
    let bytes: Vec<Vec<u8>> = export
        .tensors
        .iter()
        .map(|tensor| tensor.values.iter().flat_map(|v| v.to_le_bytes()).collect())
        .collect();
    let views = export.tensors.iter().zip(&bytes).map(|(tensor, bytes)| {
        TensorView::new(Dtype::F32, tensor.shape.clone(), bytes)
            .map(|view| (tensor.name.as_str(), view))
    });
    let views = views.collect::<Result<Vec<_>, _>>().map_err(failed)?;
    let metadata = HashMap::from([(POLICY_KEY.to_owned(), description.to_string())]);
    Ok(safetensors::serialize(views, Some(metadata)).map_err(failed)?)
}
