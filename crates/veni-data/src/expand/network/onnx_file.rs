//! ONNX files for tests: the few messages of onnx.proto3 that a small network needs, encoded by hand.

/// Element types of onnx.proto3's `TensorProto.DataType`.
pub(crate) const FLOAT: u64 = 1;
pub(crate) const INT32: u64 = 6;

/// A graph from inputs "x" to outputs "y".
#[derive(Clone, Default)]
pub(crate) struct OnnxFile {
    graph: Vec<u8>,
    values: usize,
}

impl OnnxFile {
    /// One input "x" and one output "y" of floats, both 1 × 3 × `size`; a side of 0 is free.
    pub(crate) fn image(size: [u64; 2]) -> Self {
        let shape = [1, 3, size[0], size[1]];
        Self::default().value(11, "x", FLOAT, &shape).value(12, "y", FLOAT, &shape)
    }

    /// An input (field 11) or output (12). Without a shape it declares none; a side of 0 is free.
    pub(crate) fn value(mut self, field: u64, name: &str, element: u64, shape: &[u64]) -> Self {
        let mut tensor = number(1, element);
        let sides: Vec<u8> = (shape.iter().enumerate())
            .flat_map(|(k, &side)| {
                let side = if side == 0 { bytes(2, format!("side_{k}").as_bytes()) } else { number(1, side) };
                bytes(1, &side)
            })
            .collect();
        if !shape.is_empty() {
            tensor.extend(bytes(2, &sides));
        }
        let info = [bytes(1, name.as_bytes()), bytes(2, &bytes(1, &tensor))].concat();
        self.graph.extend(bytes(field, &info));
        self
    }

    /// A float constant.
    pub(crate) fn constant(mut self, name: &str, shape: &[u64], values: &[f32]) -> Self {
        let raw: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let sides = shape.iter().flat_map(|side| number(1, *side)).collect();
        let tensor = [sides, number(2, FLOAT), bytes(8, name.as_bytes()), bytes(9, &raw)].concat();
        self.graph.extend(bytes(5, &tensor));
        self
    }

    /// A float constant that is said to be in another file.
    pub(crate) fn elsewhere(mut self, name: &str, place: &[(&str, &str)]) -> Self {
        let entry = |(key, value): &(&str, &str)| {
            bytes(13, &[bytes(1, key.as_bytes()), bytes(2, value.as_bytes())].concat())
        };
        let place = place.iter().flat_map(entry).collect();
        let tensor = [number(2, FLOAT), bytes(8, name.as_bytes()), place, number(14, 1)];
        self.graph.extend(bytes(5, &tensor.concat()));
        self
    }

    /// An operator with attributes that are lists of whole numbers.
    pub(crate) fn node(mut self, op: &str, inputs: &[&str], output: &str, ints: &[(&str, &[u64])]) -> Self {
        self.values += 1;
        let mut node: Vec<u8> = inputs.iter().flat_map(|name| bytes(1, name.as_bytes())).collect();
        node.extend(
            [bytes(2, output.as_bytes()), bytes(3, format!("{op}_{}", self.values).as_bytes())].concat(),
        );
        node.extend(bytes(4, op.as_bytes()));
        for (name, list) in ints {
            let list = list.iter().flat_map(|v| number(8, *v)).collect();
            node.extend(bytes(5, &[bytes(1, name.as_bytes()), list, number(20, 7)].concat()));
        }
        self.graph.extend(bytes(1, &node));
        self
    }

    /// y = `factor` · x.
    pub(crate) fn times(factor: f32, size: [u64; 2]) -> Self {
        Self::image(size).constant("factor", &[], &[factor]).node("Mul", &["x", "factor"], "y", &[])
    }

    /// The file: intermediate representation 8, operator set 13.
    pub(crate) fn bytes(self) -> Vec<u8> {
        let graph = [self.graph, bytes(2, b"test")].concat();
        [number(1, 8), bytes(7, &graph), bytes(8, &number(2, 13))].concat()
    }
}

/// A field of wire type 0.
fn number(field: u64, value: u64) -> Vec<u8> {
    [varint(field << 3), varint(value)].concat()
}

/// A field of wire type 2.
fn bytes(field: u64, content: &[u8]) -> Vec<u8> {
    [varint(field << 3 | 2), varint(content.len() as u64), content.to_vec()].concat()
}

fn varint(mut value: u64) -> Vec<u8> {
    let mut out = Vec::new();
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
    out
}
