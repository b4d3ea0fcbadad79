// The work of one workgroup: a tile of directions by all hidden features, in registers.
//
// The invocation with `role` owns eight features, columns g and g + VENI_GROUPS, of eight directions: quads
// b and b + VENI_QUADS / 2 of the tile, with g = role % VENI_GROUPS and b = role / VENI_GROUPS. So neighbours read
// neighbouring weights and the same activations.

struct Role {
    group: u32,
    block: u32,
}

// [i] and [i + 8]: the two columns of direction i.
alias Tile = array<vec4f, 16>;

// Quads of directions in a tile.
const VENI_QUADS: u32 = VENI_TILE / 4u;

// Operands of one step, weights then activations; between products, partial sums.
var<workgroup> slab: array<vec4f, VENI_SLAB>;
var<workgroup> tile_directions: array<vec4f, VENI_TILE>;

fn role_of(index: u32) -> Role {
    return Role(index % VENI_GROUPS, index / VENI_GROUPS);
}

fn threads() -> u32 {
    return VENI_GROUPS * (VENI_TILE / 8u);
}

// The same vector for all directions of the tile.
fn broadcast(low: vec4f, high: vec4f) -> Tile {
    return Tile(low, low, low, low, low, low, low, low, high, high, high, high, high, high, high, high);
}

// Adds a vector of the features, given by its two columns, to every direction.
fn add_vector(x: ptr<function, Tile>, low: vec4f, high: vec4f) {
    VENI_FOR_EIGHT((*x)[@] += low;)
    VENI_FOR_HIGH((*x)[@] += high;)
}

// Weights of `rows` matrix rows into the slab.
fn stage_weights(first: u32, rows: u32, role: u32) {
    for (var i = role; i < rows * VENI_COLUMNS; i += threads()) {
        slab[i] = vec4f(veni_matrices[first * VENI_COLUMNS + i]);
    }
}

// Where activations begin in the slab.
fn activations() -> u32 {
    return VENI_ROWS * VENI_COLUMNS;
}

// Four rows of the slab, one per feature of a column, from the registers of its owner.
fn stage_column(row: u32, role: Role, a: array<vec4f, 8>) {
    let at = activations() + row * VENI_QUADS + role.block;
    let half = VENI_QUADS / 2u;
    slab[at] = vec4f(a[0].x, a[1].x, a[2].x, a[3].x);
    slab[at + half] = vec4f(a[4].x, a[5].x, a[6].x, a[7].x);
    slab[at + VENI_QUADS] = vec4f(a[0].y, a[1].y, a[2].y, a[3].y);
    slab[at + VENI_QUADS + half] = vec4f(a[4].y, a[5].y, a[6].y, a[7].y);
    slab[at + 2u * VENI_QUADS] = vec4f(a[0].z, a[1].z, a[2].z, a[3].z);
    slab[at + 2u * VENI_QUADS + half] = vec4f(a[4].z, a[5].z, a[6].z, a[7].z);
    slab[at + 3u * VENI_QUADS] = vec4f(a[0].w, a[1].w, a[2].w, a[3].w);
    slab[at + 3u * VENI_QUADS + half] = vec4f(a[4].w, a[5].w, a[6].w, a[7].w);
}

// y += the slab's activations times its weights, over `rows` inputs. Four at a time: loops have a price of their own.
fn accumulate(rows: u32, role: Role, y: ptr<function, Tile>) {
    var k = 0u;
    for (; k + 4u <= rows; k += 4u) {
        VENI_FOR_FOUR(accumulate_row(k + @u, role, y);)
    }
    for (; k < rows; k++) {
        accumulate_row(k, role, y);
    }
}

fn accumulate_row(k: u32, role: Role, y: ptr<function, Tile>) {
    let low = slab[k * VENI_COLUMNS + role.group];
    let high = slab[k * VENI_COLUMNS + VENI_GROUPS + role.group];
    let at = activations() + k * VENI_QUADS + role.block;
    let p = slab[at];
    let q = slab[at + VENI_QUADS / 2u];
    let x = array<f32, 8>(p.x, p.y, p.z, p.w, q.x, q.y, q.z, q.w);
    VENI_FOR_EIGHT((*y)[@] = fma(vec4f(x[@]), low, (*y)[@]);)
    VENI_FOR_EIGHT((*y)[@ + 8] = fma(vec4f(x[@]), high, (*y)[@ + 8]);)
}

// y += x times the matrix that begins at row `first`. Begins and ends with a barrier around the slab's use.
fn multiply(first: u32, index: u32, x: ptr<function, Tile>, y: ptr<function, Tile>) {
    let role = role_of(index);
    let columns_per_step = VENI_STEP / 4u;
    for (var column = 0u; column < VENI_COLUMNS; column += columns_per_step) {
        let columns = min(columns_per_step, VENI_COLUMNS - column);
        stage_weights(first + 4u * column, 4u * columns, index);
        if role.group >= column && role.group < column + columns {
            stage_column(4u * (role.group - column), role, low_columns(x));
        }
        let high = role.group + VENI_GROUPS;
        if high >= column && high < column + columns {
            stage_column(4u * (high - column), role, high_columns(x));
        }
        workgroupBarrier();
        accumulate(4u * columns, role, y);
        workgroupBarrier();
    }
}

fn low_columns(x: ptr<function, Tile>) -> array<vec4f, 8> {
    return array<vec4f, 8>((*x)[0], (*x)[1], (*x)[2], (*x)[3], (*x)[4], (*x)[5], (*x)[6], (*x)[7]);
}

fn high_columns(x: ptr<function, Tile>) -> array<vec4f, 8> {
    return array<vec4f, 8>((*x)[8], (*x)[9], (*x)[10], (*x)[11], (*x)[12], (*x)[13], (*x)[14], (*x)[15]);
}

// y += encoded directions times the input matrix.
fn project(latent: u32, index: u32, y: ptr<function, Tile>) {
    let role = role_of(index);
    for (var input = 0u; input < veni_padded_inputs(); input += VENI_INPUT_STEP) {
        stage_weights(5u * input, 5u * VENI_INPUT_STEP, index);
        for (var task = index; task < VENI_INPUT_STEP * VENI_QUADS; task += threads()) {
            stage_features(latent, input + task / VENI_QUADS, task / VENI_QUADS, task % VENI_QUADS);
        }
        workgroupBarrier();
        accumulate(5u * VENI_INPUT_STEP, role, y);
        workgroupBarrier();
    }
}

// Five rows of the slab: the features of one input for four directions. Padding has weights 0.
fn stage_features(latent: u32, input: u32, place: u32, quad: u32) {
    let i = min(input, veni_inputs() - 1u);
    let a = veni_encode(latent, i, tile_directions[4u * quad].xyz);
    let b = veni_encode(latent, i, tile_directions[4u * quad + 1u].xyz);
    let c = veni_encode(latent, i, tile_directions[4u * quad + 2u].xyz);
    let d = veni_encode(latent, i, tile_directions[4u * quad + 3u].xyz);
    let at = activations() + 5u * place * VENI_QUADS + quad;
    slab[at] = vec4f(a.sin_once, b.sin_once, c.sin_once, d.sin_once);
    slab[at + VENI_QUADS] = vec4f(a.sin_fourfold, b.sin_fourfold, c.sin_fourfold, d.sin_fourfold);
    slab[at + 2u * VENI_QUADS] = vec4f(a.cos_once, b.cos_once, c.cos_once, d.cos_once);
    slab[at + 3u * VENI_QUADS] = vec4f(a.cos_fourfold, b.cos_fourfold, c.cos_fourfold, d.cos_fourfold);
    slab[at + 4u * VENI_QUADS] = vec4f(a.value, b.value, c.value, d.value);
}
