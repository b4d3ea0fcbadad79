// Group 0 of every kernel. `VeniWeight` is vec4f or vec4h.

@group(0) @binding(0) var<storage, read> veni_matrices: array<VeniWeight>;
@group(0) @binding(1) var<storage, read> veni_vectors: array<vec4f>;
@group(0) @binding(2) var<storage, read> veni_latents: array<vec4f>;
@group(0) @binding(3) var<uniform> request: VeniRequest;
