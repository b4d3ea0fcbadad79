use super::*;

/// A real file of PyTorch's (the reference's trainer), and numbers that were read from it there.
const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/golden/ckpt_renipp");

fn real() -> Vec<u8> {
    std::fs::read(format!("{FOLDER}/nerfstudio_models/step-000001000.ckpt")).unwrap()
}

#[test]
fn a_real_file_of_pytorch_is_read_to_the_bit() {
    let checkpoint = Checkpoint::from_bytes(real()).unwrap();
    let vectors = Checkpoint::open(Path::new(&format!("{FOLDER}/vectors.safetensors"))).unwrap();
    for (ours, golden) in [("train_mu", "in.train_mu"), ("eval_mu", "in.eval_mu")] {
        let name = checkpoint.names().find(|n| n.ends_with(&format!("field.{ours}"))).unwrap().to_owned();
        assert!(name.starts_with("pipeline."), "{name}");
        assert_eq!(checkpoint.tensor(&name).unwrap(), vectors.tensor(golden).unwrap());
    }
    assert!(checkpoint.names().count() > 50);
}

#[test]
fn every_truncation_and_many_damages_are_errors_or_readable() {
    let whole = real();
    for part in [0, 1, 4, 100, whole.len() / 2, whole.len() - 1] {
        assert!(Checkpoint::from_bytes(whole[..part].to_vec()).is_err(), "{part} bytes");
    }
    // a flipped byte may go unnoticed (no checksum is read), but must never end in a panic
    for position in (0..30_000).step_by(37) {
        let mut file = whole.clone();
        file[position] ^= 0x55;
        if let Ok(checkpoint) = Checkpoint::from_bytes(file) {
            for name in checkpoint.names() {
                let _ = checkpoint.tensor(name);
            }
        }
    }
}

/// A pickle instruction by instruction, as `torch.save` writes a dictionary of tensors.
struct Writer(Vec<u8>);

impl Writer {
    fn text(&mut self, text: &str) {
        self.0.push(b'X');
        self.0.extend((text.len() as u32).to_le_bytes());
        self.0.extend(text.as_bytes());
    }

    fn int(&mut self, value: usize) {
        self.0.push(b'J');
        self.0.extend((value as u32).to_le_bytes());
    }

    fn global(&mut self, module: &str, name: &str) {
        self.0.extend(format!("c{module}\n{name}\n").bytes());
    }

    fn ints(&mut self, values: &[usize]) {
        self.0.push(b'(');
        values.iter().for_each(|v| self.int(*v));
        self.0.push(b't');
    }

    /// Name and tensor: a view of storage `key`, which has `count` elements of `kind`.
    fn tensor(
        &mut self,
        name: &str,
        (kind, key, count): (&str, &str, usize),
        offset: usize,
        size: [&[usize]; 2],
    ) {
        self.text(name);
        self.global("torch._utils", "_rebuild_tensor_v2");
        self.0.extend(b"((");
        self.text("storage");
        self.global("torch", kind);
        self.text(key);
        self.text("cpu");
        self.int(count);
        self.0.extend(b"tQ");
        self.int(offset);
        self.ints(size[0]);
        self.ints(size[1]);
        self.0.push(0x89);
        self.global("collections", "OrderedDict");
        self.0.extend(b")RtR");
    }
}

/// Two tensors that share one storage of f32 (one of them transposed), one of f16, and integers.
fn dictionary() -> Writer {
    let mut pickle = Writer(b"\x80\x02}(".to_vec());
    pickle.tensor("a.weight", ("FloatStorage", "7", 6), 0, [&[2, 3], &[3, 1]]);
    pickle.tensor("a.turned", ("FloatStorage", "7", 6), 1, [&[2, 2], &[1, 3]]);
    pickle.tensor("b", ("HalfStorage", "12", 2), 0, [&[2], &[1]]);
    pickle.tensor("count", ("LongStorage", "3", 1), 0, [&[], &[]]);
    pickle.0.extend(b"u.");
    pickle
}

fn storages() -> [(&'static str, Vec<u8>, u64); 3] {
    let floats = (0..6).flat_map(|v| (v as f32 + 0.5).to_le_bytes()).collect();
    let halves = [1.5f32, -2.0].iter().flat_map(|v| f16::from_f32(*v).to_le_bytes()).collect();
    [("7", floats, 6), ("12", halves, 2), ("3", 9u64.to_le_bytes().to_vec(), 1)]
}

fn legacy() -> Vec<u8> {
    let mut file = legacy::MAGIC.to_vec();
    file.extend(b"\x80\x02M\xe9\x03."); // protocol 1001
    file.extend(b"\x80\x02}."); // the system: empty
    file.extend(dictionary().0);
    let mut keys = Writer(b"\x80\x02](".to_vec());
    storages().iter().for_each(|(key, ..)| keys.text(key));
    keys.0.extend(b"e.");
    file.extend(keys.0);
    for (_, bytes, count) in storages() {
        file.extend(count.to_le_bytes());
        file.extend(bytes);
    }
    file
}

fn check(file: Vec<u8>) {
    let checkpoint = Checkpoint::from_bytes(file).unwrap();
    assert_eq!(checkpoint.names().collect::<Vec<_>>(), ["a.turned", "a.weight", "b", "count"]);
    let tensor = |name| checkpoint.tensor(name).unwrap();
    assert_eq!(tensor("a.weight"), Array { shape: vec![2, 3], data: vec![0.5, 1.5, 2.5, 3.5, 4.5, 5.5] });
    assert_eq!(tensor("a.turned"), Array { shape: vec![2, 2], data: vec![1.5, 4.5, 2.5, 5.5] });
    assert_eq!(tensor("b").data, [1.5, -2.0]);
    assert!(checkpoint.tensor("count").unwrap_err().to_string().contains("integers"));
    assert!(checkpoint.tensor("c").unwrap_err().to_string().contains("no tensor c"));
}

#[test]
fn the_format_before_pytorch_1_6() {
    check(legacy());
    let whole = legacy();
    for part in 0..whole.len() {
        assert!(Checkpoint::from_bytes(whole[..part].to_vec()).is_err(), "{part} of {} bytes", whole.len());
    }
}

#[test]
fn views_stay_inside_of_their_storage() {
    for (offset, shape, strides) in
        [(5usize, [2usize, 1], [1usize, 1]), (0, [2, 3], [6, 1]), (0, [1 << 30, 1 << 30], [1, 1])]
    {
        let mut pickle = Writer(b"\x80\x02}(".to_vec());
        pickle.tensor("far", ("FloatStorage", "7", 6), offset, [&shape, &strides]);
        pickle.0.extend(b"u.");
        let mut arena = arena::Arena::default();
        let (root, _) = pickle::read(&pickle.0, 0, &mut arena).unwrap();
        let views = torch::views(&arena, root, &|_| Some(0..24)).unwrap();
        let checkpoint = Checkpoint { file: vec![0; 24], views };
        assert!(checkpoint.tensor("far").unwrap_err().to_string().contains("outside"), "{offset} {shape:?}");
    }
}

#[test]
fn pickles_that_would_run_code_or_never_end_are_refused() {
    let read = |bytes: &[u8]| pickle::read(bytes, 0, &mut arena::Arena::default());
    // protocol 0's instance opcode
    assert!(
        matches!(read(b"(S'rm'\nios\nsystem\n."), Err(Error::Unsupported { message, .. }) if message.contains("safetensors"))
    );
    // a call is kept as a name, never made
    let mut arena = arena::Arena::default();
    let (call, _) = pickle::read(b"\x80\x02cos\nsystem\nU\x02rm\x85R.", 0, &mut arena).unwrap();
    assert!(matches!(arena.get(call), arena::Value::Call(name, _) if name == "os system"));
    for broken in [&b"."[..], b"e.", b"t.", b"h\x01.", b"s.", b"R.", b"\x93."] {
        assert!(matches!(read(broken), Err(Error::Invalid { .. })), "{broken:?}");
    }
    // dictionaries that hold each other four times, twenty deep: 4^20 paths
    let mut nested = Writer(b"\x80\x02}q\x00".to_vec());
    for level in 0..20u8 {
        nested.0.extend(b"0}(");
        for name in ["a", "b", "c", "d"] {
            nested.text(name);
            nested.0.extend([b'h', level]);
        }
        nested.0.extend([b'u', b'q', level + 1]);
    }
    nested.0.push(b'.');
    let mut arena = arena::Arena::default();
    let (root, _) = pickle::read(&nested.0, 0, &mut arena).unwrap();
    assert!(torch::views(&arena, root, &|_| None).unwrap().is_empty());
}
