//! A whole MLP as one candle operation, for losses on candle's tape.

use candle_core::{CpuStorage, CustomOp2, DType, Layout, Result, Shape, Tensor, bail};
use parking_lot::Mutex;

use crate::learn::networks::adam::slice;
use crate::learn::networks::mlp::{Activations, GradientRequest, Mlp, Packed};

/// Returns `mlp(x)`, `(rows, outputs)`, for `x` `(rows, inputs)` and flat `parameters` (see
/// `mlp::Mlp` for their order), both f32 on the CPU. Uses the same kernels as
/// [`crate::learn::Gdg::update_on`], which calls them without a tape.
///
/// # Errors
/// Returns an error if the tensors have the wrong sizes or are on another device.
pub fn fused_mlp(mlp: &Mlp, x: &Tensor, parameters: &Tensor) -> Result<Tensor> {
    if x.dims().len() != 2 || x.dim(1)? != mlp.inputs || parameters.dims() != [mlp.parameters()] {
        bail!("{:?} inputs and {:?} parameters for {mlp:?}", x.dims(), parameters.dims());
    }
    let op = FusedMlp { mlp: *mlp, saved: Mutex::default() };
    x.contiguous()?.apply_op2(&parameters.contiguous()?, op)
}

struct FusedMlp {
    mlp: Mlp,
    /// What the backward pass needs from the forward pass.
    saved: Mutex<(Activations, Packed)>,
}

fn numbers<'a>(storage: &'a CpuStorage, layout: &Layout) -> Result<&'a [f32]> {
    match (storage, layout.contiguous_offsets()) {
        (CpuStorage::F32(data), Some((from, to))) => Ok(&data[from..to]),
        _ => bail!("the fused MLP needs contiguous f32"),
    }
}

impl CustomOp2 for FusedMlp {
    fn name(&self) -> &'static str {
        "fused-mlp"
    }

    fn cpu_fwd(
        &self,
        x: &CpuStorage,
        lx: &Layout,
        w: &CpuStorage,
        lw: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let (x, parameters) = (numbers(x, lx)?, numbers(w, lw)?);
        let rows = x.len() / self.mlp.inputs;
        let mut y = vec![0.0; rows * self.mlp.outputs];
        let (activations, packed) = &mut *self.saved.lock();
        self.mlp.pack(parameters, true, packed);
        self.mlp.forward(parameters, packed, x, &mut y, activations);
        Ok((CpuStorage::F32(y), Shape::from((rows, self.mlp.outputs))))
    }

    fn bwd(
        &self,
        x: &Tensor,
        w: &Tensor,
        _: &Tensor,
        dy: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let (mut dx, mut dw) = (vec![0.0; x.elem_count()], vec![0.0; w.elem_count()]);
        let dy = dy.to_dtype(DType::F32)?.contiguous()?;
        {
            let of = |t: &Tensor| t.flatten_all()?.to_vec1::<f32>();
            let (x, (w, layout), dy) = (of(x)?, w.storage_and_layout(), of(&dy)?);
            let parameters = &slice(&w)?[layout.start_offset()..];
            let (activations, packed) = &mut *self.saved.lock();
            let wanted = GradientRequest { parameters: Some(&mut dw), inputs: Some((0, &mut dx)) };
            self.mlp.backward(parameters, packed, &x, &dy, activations, wanted);
        }
        Ok((
            Some(Tensor::from_vec(dx, x.shape(), x.device())?),
            Some(Tensor::from_vec(dw, w.shape(), w.device())?),
        ))
    }
}
