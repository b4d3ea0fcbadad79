//! Python values, as far as PyTorch's files need them.
//!
//! They live in an arena and refer to each other by index, so that shared, cyclic or deeply nested data costs neither
//! copies nor stack.

/// Index of a value in its [`Arena`].
pub(super) type Id = usize;

/// A Python value, as far as it matters here.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    /// An integer of at most 64 bits.
    Int(i64),
    /// Text.
    Text(String),
    /// A list or tuple.
    Sequence(Vec<Id>),
    /// A dictionary, ordered or not.
    Map(Vec<(Id, Id)>),
    /// A class or function, `module name`.
    Global(String),
    /// What a persistent identifier stands for: in PyTorch's files a storage.
    Persistent(Id),
    /// The call of a global with its arguments (a sequence).
    Call(String, Id),
    /// Anything that no tensor depends on.
    Other,
}

/// All values of a pickle.
#[derive(Debug, Default)]
pub(super) struct Arena(Vec<Value>);

impl Arena {
    pub(super) fn get(&self, id: Id) -> &Value {
        &self.0[id]
    }

    /// Number of values so far.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    pub(super) fn get_mut(&mut self, id: Id) -> &mut Value {
        &mut self.0[id]
    }

    /// Adds a value.
    pub(super) fn push(&mut self, value: Value) -> Id {
        self.0.push(value);
        self.0.len() - 1
    }
}
