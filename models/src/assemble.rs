//! A linear head on a backbone, in one ONNX file.

use crate::ModelError;
use crate::onnx::{Axis, FLOAT, Graph, Model, Node, Shape, Tensor, TensorType, Type, ValueInfo};
use prost::Message;
use std::collections::BTreeSet;

/// A linear classifier over pooled feature maps: logit of structure = bias + sum over taps of w . mean(f).
#[derive(Clone, Debug, PartialEq)]
pub struct Head {
    /// What it looks at.
    pub taps: Vec<Tap>,
    /// What is added.
    pub bias: f32,
}

/// Weights of one feature map.
#[derive(Clone, Debug, PartialEq)]
pub struct Tap {
    /// The backbone's output, `[n, channels, h, w]`.
    pub output: String,
    /// One weight a channel.
    pub weights: Vec<f32>,
}

/// Name of the output with the logits of background and structure.
pub const LOGITS: &str = "logits";
/// What everything that belongs to a head is named after.
const PREFIX: &str = "sfm_head";

/// Name of the map of an output's share of the logit.
#[must_use]
pub fn map_name(output: &str) -> String {
    format!("map_{output}")
}

/// The backbone with a head: output `logits` `[n, 2]` (background, structure) and for each tap a map `[n, 1, h, w]` whose mean over a patch is the tap's share
/// of the logit. Of the outputs that the backbone had, those of the taps stay, so that another head can be set on the result; a head that it had goes.
///
/// A linear head and the mean commute, so that maps of a whole image hold the logits of all its patches, up to what lies beside a patch.
///
/// # Errors
/// [`ModelError::Backbone`] where the bytes are no ONNX model, or lack the outputs.
pub fn with_head(backbone: &[u8], head: &Head) -> Result<Vec<u8>, ModelError> {
    let mut model = Model::decode(backbone)?;
    let graph = model.graph.as_mut().ok_or_else(|| ModelError::Backbone("it has no graph".to_owned()))?;
    let outputs = names(&graph.output)?;
    if let Some(tap) = head.taps.iter().find(|t| !outputs.contains(&t.output)) {
        return Err(ModelError::Backbone(format!("it has no output {}; it has {}", tap.output, outputs.join(", "))));
    }
    let mut kept = outputs.iter().map(|name| head.taps.iter().any(|t| t.output == *name));
    graph.output.retain(|_| kept.next().unwrap_or(false));
    let inputs = names(&graph.input)?;
    keep_what_is_needed(graph, inputs)?;

    let mut added = Added { graph };
    let mut sum: Option<String> = None;
    for tap in &head.taps {
        let map = map_name(&tap.output);
        let weights = added.constant(&format!("w_{}", tap.output), &[1, tap.weights.len() as i64, 1, 1], &tap.weights);
        added.node("Conv", &[&tap.output, &weights], &map);
        let mean = added.node("GlobalAveragePool", &[&map], &named(&format!("mean_{}", tap.output)));
        sum = Some(match sum {
            Some(sum) => added.node("Add", &[&sum, &mean], &named(&format!("sum_{}", tap.output))),
            None => mean,
        });
        added.output(&map, &[None, Some(1), None, None]);
    }
    let sum = sum.ok_or_else(|| ModelError::Backbone("the head looks at nothing".to_owned()))?;
    let bias = added.constant("bias", &[1], &[head.bias]);
    // The difference of the two logits is that of the head: their softmax is its logistic function.
    let halves = added.constant("halves", &[1, 2], &[-0.5, 0.5]);
    let logit = added.node("Add", &[&sum, &bias], &named("logit"));
    let column = added.node("Flatten", &[&logit], &named("column"));
    added.node("MatMul", &[&column, &halves], LOGITS);
    added.output(LOGITS, &[None, Some(2)]);
    Ok(model.encode_to_vec())
}

/// A graph that grows at its end.
struct Added<'a> {
    graph: &'a mut Graph,
}

impl Added<'_> {
    fn node(&mut self, operator: &str, inputs: &[&str], output: &str) -> String {
        let node = Node {
            input: inputs.iter().map(|&i| i.to_owned()).collect(),
            output: vec![output.to_owned()],
            name: named(&format!("{operator}_{output}")),
            op_type: operator.to_owned(),
            attribute: Vec::new(),
        };
        self.graph.node.push(node.encode_to_vec());
        output.to_owned()
    }

    fn constant(&mut self, name: &str, dims: &[i64], values: &[f32]) -> String {
        let tensor = Tensor { dims: dims.to_vec(), data_type: FLOAT, float_data: values.to_vec(), name: named(name) };
        self.graph.initializer.push(tensor.encode_to_vec());
        tensor.name
    }

    fn output(&mut self, name: &str, axes: &[Option<i64>]) {
        let shape = Shape { axes: axes.iter().map(|&length| Axis { length }).collect() };
        let kind = Type { tensor: Some(TensorType { element: FLOAT, shape: Some(shape) }) };
        self.graph.output.push(ValueInfo { name: name.to_owned(), kind: Some(kind) }.encode_to_vec());
    }
}

fn named(name: &str) -> String {
    format!("{PREFIX}_{name}")
}

fn names(values: &[Vec<u8>]) -> Result<Vec<String>, ModelError> {
    values.iter().map(|v| Ok(ValueInfo::decode(v.as_slice())?.name)).collect()
}

/// Drops what leads to no output, an earlier head among it: it would be computed all the same, and clash with the new one.
fn keep_what_is_needed(graph: &mut Graph, inputs: Vec<String>) -> Result<(), ModelError> {
    let mut needed: BTreeSet<String> = names(&graph.output)?.into_iter().chain(inputs).collect();
    let mut nodes = Vec::with_capacity(graph.node.len());
    // Nodes stand in the order of computation.
    for bytes in std::mem::take(&mut graph.node).into_iter().rev() {
        let node = Node::decode(bytes.as_slice())?;
        if node.output.iter().any(|o| needed.contains(o)) {
            needed.extend(node.input);
            nodes.push(bytes);
        }
    }
    graph.node = nodes.into_iter().rev().collect();
    let mut constants = Vec::with_capacity(graph.initializer.len());
    for bytes in std::mem::take(&mut graph.initializer) {
        if needed.contains(&Tensor::decode(bytes.as_slice())?.name) {
            constants.push(bytes);
        }
    }
    graph.initializer = constants;
    // Types of what lies between are inferred again.
    graph.value_info.clear();
    Ok(())
}

/// A backbone without a network: its only output, `colour`, is its input, `image`. A head on it tells classes by colour alone, the least that a network must
/// be better than.
#[must_use]
pub fn colour_backbone() -> Vec<u8> {
    let mut graph = Graph { name: "colour".to_owned(), ..Graph::default() };
    let mut added = Added { graph: &mut graph };
    added.node("Identity", &["image"], "colour");
    added.output("colour", &[None, Some(3), None, None]);
    graph.input = graph.output.iter().map(|o| ValueInfo { name: "image".to_owned(), kind: kind(o) }.encode_to_vec()).collect();
    // `OperatorSetIdProto`, field 2: the version of the operators.
    let operators = vec![0x10, 17];
    Model { ir_version: 8, graph: Some(graph), opset_import: vec![operators], ..Model::default() }.encode_to_vec()
}

fn kind(value: &[u8]) -> Option<Type> {
    ValueInfo::decode(value).ok()?.kind
}

#[cfg(test)]
mod tests {
    use super::*;

    fn red_minus_blue() -> Head {
        Head { taps: vec![Tap { output: "colour".to_owned(), weights: vec![1.0, 0.0, -1.0] }], bias: 0.5 }
    }

    fn outputs(model: &[u8]) -> Vec<String> {
        names(&Model::decode(model).expect("a model").graph.expect("a graph").output).expect("names")
    }

    #[test]
    fn a_second_head_takes_the_place_of_the_first() {
        let first = with_head(&colour_backbone(), &red_minus_blue()).expect("a head");
        assert_eq!(outputs(&first), ["colour", "map_colour", "logits"]);
        assert_eq!(with_head(&first, &red_minus_blue()).expect("a head"), first);
    }

    #[test]
    fn what_is_no_model_or_lacks_the_output_is_told() {
        assert!(with_head(b"\xff\xff no model", &red_minus_blue()).is_err());
        let mut head = red_minus_blue();
        head.taps[0].output = "s8".to_owned();
        let error = with_head(&colour_backbone(), &head).expect_err("no such output").to_string();
        assert!(error.contains("s8") && error.contains("colour"), "{error}");
    }
}
