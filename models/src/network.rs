//! A network and the sessions that run it.

use crate::{ModelError, Runtime};
use ort::session::Session;
use ort::session::builder::GraphOptimizationLevel;
use ort::value::{Outlet, TensorRef, ValueType};
use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// Values with a shape, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Length of each axis.
    pub shape: Vec<usize>,
    /// The values.
    pub data: Vec<f32>,
}

/// An input or output: its name and the lengths of its axes, -1 for any.
pub(crate) type Port = (String, Vec<i64>);

/// A network. May be shared among threads: each run takes a session of its own, of one thread, so that the values do not depend on the number of threads.
#[derive(Debug)]
pub(crate) struct Network {
    pub path: PathBuf,
    pub bytes: Cow<'static, [u8]>,
    pub inputs: Vec<Port>,
    pub outputs: Vec<Port>,
    runtime: Runtime,
    idle: Mutex<Vec<Session>>,
}

impl Network {
    pub fn new(path: PathBuf, bytes: Cow<'static, [u8]>, runtime: &Runtime) -> Result<Self, ModelError> {
        let network = Self { path, bytes, inputs: Vec::new(), outputs: Vec::new(), runtime: runtime.clone(), idle: Mutex::default() };
        let session = network.session()?;
        let (inputs, outputs) = (ports(session.inputs()), ports(session.outputs()));
        network.lock().push(session);
        Ok(Self { inputs, outputs, ..network })
    }

    /// Runs it on `[n, 3, height, width]` values and gives the outputs that are named.
    pub fn run(&self, input: &str, shape: [usize; 4], values: &[f32], outputs: &[&str]) -> Result<Vec<Tensor>, ModelError> {
        assert_eq!(shape.iter().product::<usize>(), values.len(), "one value for each place");
        let idle = self.lock().pop();
        let mut session = match idle {
            Some(session) => session,
            None => self.session()?,
        };
        let tensors = self.run_in(&mut session, input, shape, values, outputs);
        self.lock().push(session);
        tensors
    }

    fn run_in(
        &self,
        session: &mut Session,
        input: &str,
        shape: [usize; 4],
        values: &[f32],
        outputs: &[&str],
    ) -> Result<Vec<Tensor>, ModelError> {
        let refused = |e: ort::Error| self.refused(e.to_string());
        let tensor = TensorRef::from_array_view((shape, values)).map_err(refused)?;
        let found = session.run(ort::inputs![input => tensor]).map_err(refused)?;
        let tensor = |name: &&str| {
            let value = found.get(name).ok_or_else(|| self.refused(format!("it has no output {name}")))?;
            let (shape, data) = value.try_extract_tensor::<f32>().map_err(refused)?;
            Ok(Tensor { shape: shape.iter().map(|&n| n as usize).collect(), data: data.to_vec() })
        };
        outputs.iter().map(tensor).collect()
    }

    fn session(&self) -> Result<Session, ModelError> {
        let refused = |e: ort::Error| self.refused(e.to_string());
        let builder = Session::builder(&self.runtime.environment).map_err(refused)?;
        let builder = builder.with_optimization_level(GraphOptimizationLevel::All).unwrap_or_else(|e| e.recover());
        let mut builder = builder.with_intra_threads(1).unwrap_or_else(|e| e.recover());
        builder.commit_from_memory(&self.bytes).map_err(refused)
    }

    fn refused(&self, reason: String) -> ModelError {
        ModelError::Model { model: self.path.clone(), reason }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Session>> {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn ports(outlets: &[Outlet]) -> Vec<Port> {
    let axes = |dtype: &ValueType| dtype.tensor_shape().map(|s| s.to_vec()).unwrap_or_default();
    outlets.iter().map(|o| (o.name().to_owned(), axes(o.dtype()))).collect()
}

/// The names, for people.
pub(crate) fn names(ports: &[Port]) -> String {
    ports.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ")
}
