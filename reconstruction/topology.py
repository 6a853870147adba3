"""From winners to a two-manifold: competitive Hebbian edges and faces, then repairs."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree


def find_cliques(triples: np.ndarray, num_units: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the witnessed edges `[E, 2]` (keys sorted) and all triangles of them `[F, 3]`."""
    triples = np.sort(triples.astype(np.int64), axis=1)
    keys = np.unique((triples[:, 0] * num_units + triples[:, 1]) * num_units + triples[:, 2])
    c = keys % num_units
    a, b = np.divmod(keys // num_units, num_units)
    edge_keys = np.unique(np.concatenate([a * num_units + b, a * num_units + c, b * num_units + c]))
    edges = np.stack(np.divmod(edge_keys, num_units), axis=1)
    start = np.searchsorted(edges[:, 0], np.arange(num_units + 1))
    # Every edge (i, j) with every later neighbour k of i: is (j, k) an edge?
    place = np.arange(len(edges))
    later = start[edges[:, 0] + 1] - place - 1
    first = np.repeat(place, later)
    offset = np.arange(len(first)) - np.repeat(np.cumsum(later) - later, later)
    third = edges[first + 1 + offset, 1]
    wanted = edges[first, 1] * num_units + third
    at = np.minimum(np.searchsorted(edge_keys, wanted), len(edge_keys) - 1)
    is_clique = edge_keys[at] == wanted
    faces = np.stack([edges[first, 0], edges[first, 1], third], axis=1)[is_clique]
    return edges, faces


def neighbor_table(edges, num_units, positions):
    """Return `[U, D]` neighbours, padded with the unit itself."""
    both = np.concatenate([edges, edges[:, ::-1]])
    both = both[np.argsort(both[:, 0], kind="stable")]
    degree = np.bincount(both[:, 0], minlength=num_units)
    table = np.repeat(np.arange(num_units)[:, None], max(degree.max(initial=1), 1), axis=1)
    slot = np.arange(len(both)) - np.repeat(np.cumsum(degree) - degree, degree)
    table[both[:, 0], slot] = both[:, 1]
    return table


def circumcenters(units, faces):
    a, b, c = units[faces[:, 0]], units[faces[:, 1]], units[faces[:, 2]]
    ab, ac = b - a, c - a
    d00, d01, d11 = (ab * ab).sum(1), (ab * ac).sum(1), (ac * ac).sum(1)
    det = np.maximum(d00 * d11 - d01 * d01, 1e-12 * d00 * d11 + 1e-300)
    v = (d11 * d00 - d01 * d11) / (2 * det)
    w = (d00 * d11 - d01 * d00) / (2 * det)
    offset = v[:, None] * ab + w[:, None] * ac
    return a + offset, (offset * offset).sum(1)


def emptiness(units, faces, table):
    """Return per face the smallest squared distance of an adjacent unit to the circumcentre over R²."""
    margin = np.full(len(faces), np.inf)
    alive = np.arange(len(faces))
    center, radius = circumcenters(units, faces)
    for corner in range(3):
        f = faces[alive]
        around = table[f[:, corner]]
        offset = units[around] - center[alive, None]
        d = (offset * offset).sum(-1)
        d[(around[:, :, None] == f[:, None]).any(-1)] = np.inf
        margin[alive] = np.minimum(margin[alive], d.min(1) / radius[alive])
        alive = alive[margin[alive] > 1]
    return margin


def face_normals(units, faces):
    n = np.cross(units[faces[:, 1]] - units[faces[:, 0]], units[faces[:, 2]] - units[faces[:, 0]])
    return n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300)


def sides(faces, num_units):
    """Return undirected edge keys `[F, 3]` of sides (0,1), (1,2), (2,0), and +1/-1 direction."""
    u, v = faces, faces[:, [1, 2, 0]]
    return np.minimum(u, v) * num_units + np.maximum(u, v), np.where(u < v, 1, -1)


def group_sides(faces, num_units):
    keys, direction = sides(faces, num_units)
    flat = keys.ravel()
    order = np.argsort(flat, kind="stable")
    sortd = flat[order]
    first = np.flatnonzero(np.r_[True, sortd[1:] != sortd[:-1]]) if len(flat) else np.zeros(0, int)
    count = np.diff(np.r_[first, len(flat)])
    return order, first, count, sortd, direction.ravel()


def opposite_angle_cos(units, faces, order, first):
    """cos of dihedral between the two faces of edges with exactly two: 1 flat, -1 folded back."""


def limit_to_two(units, faces, quality):
    """Drop the worst faces at edges with more than two."""
    while True:
        order, first, count, _, _ = group_sides(faces, len(units))
        full = np.flatnonzero(count > 2)
        if len(full) == 0:
            return faces, quality
        drop = np.zeros(len(faces), bool)
        for e in full:
            members = np.unique(order[first[e] : first[e] + count[e]] // 3)
            drop[members[np.argmin(quality[members])]] = True
        faces, quality = faces[~drop], quality[~drop]


def pairs_at_edges(faces, num_units):
    """Return `[P, 2]` faces that share an edge with two faces, `[P, 2]` side slots
    and whether wound alike."""
    order, first, count, _, direction = group_sides(faces, num_units)
    two = first[count == 2]
    slots = np.stack([order[two], order[two + 1]], 1)
    return slots // 3, slots % 3, direction[slots[:, 0]] != direction[slots[:, 1]]


def unfold(units, faces, quality, max_cos=-0.5):
    """Drop the worse face of pairs that fold back on one another."""
    while True:
        pair, side, _ = pairs_at_edges(faces, len(units))
        if len(pair) == 0:
            return faces, quality
        u = faces[pair[:, 0], side[:, 0]]
        v = faces[pair[:, 0], (side[:, 0] + 1) % 3]
        a = faces[pair[:, 0], (side[:, 0] + 2) % 3]
        b = faces[pair[:, 1], (side[:, 1] + 2) % 3]
        along = units[v] - units[u]
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
        pa, pb = units[a] - units[u], units[b] - units[u]
        pa -= (pa * along).sum(1, keepdims=True) * along
        pb -= (pb * along).sum(1, keepdims=True) * along
        cos = (pa * pb).sum(1) / np.maximum(np.linalg.norm(pa, axis=1) * np.linalg.norm(pb, axis=1), 1e-300)
        bad = cos > -max_cos
        if not bad.any():
            return faces, quality
        p = pair[bad]
        worse = np.where(quality[p[:, 0]] <= quality[p[:, 1]], p[:, 0], p[:, 1])
        drop = np.zeros(len(faces), bool)
        drop[worse] = True
        faces, quality = faces[~drop], quality[~drop]


def orient(units, faces, quality):
    """Wind consistently; faces at conflicts go."""
    while len(faces):
        pair, _, alike = pairs_at_edges(faces, len(units))
        normals = face_normals(units, faces)
        cos = np.abs((normals[pair[:, 0]] * normals[pair[:, 1]]).sum(1))
        n = len(faces)
        graph = coo_array((1.001 - cos, (pair[:, 0], pair[:, 1])), shape=(n, n)).tocsr()
        tree = minimum_spanning_tree(graph)
        sign_of = coo_array((np.where(alike, 1, -1), (pair[:, 0], pair[:, 1])), shape=(n, n)).tocsr()
        sign_of = sign_of + sign_of.T
        _, label = connected_components(tree, directed=False)
        sign = np.zeros(n, int)
        roots = np.unique(label, return_index=True)[1]
        both = tree + tree.T
        for root in roots:
            reached, parent = breadth_first_order(both, root, directed=False)
            sign[root] = 1
            if len(reached) > 1:
                child = reached[1:]
                relative = np.asarray(sign_of[child, parent[child]]).ravel()
                for f, p, s in zip(child.tolist(), parent[child].tolist(), relative.tolist(), strict=True):
                    sign[f] = sign[p] * s
        conflict = np.where(alike, 1, -1) * sign[pair[:, 0]] * sign[pair[:, 1]] < 0
        if not conflict.any():
            faces = faces.copy()
            flip = sign < 0
            faces[flip] = faces[flip][:, ::-1]
            return faces, quality, label
        p = pair[conflict]
        worse = np.where(quality[p[:, 0]] <= quality[p[:, 1]], p[:, 0], p[:, 1])
        drop = np.zeros(n, bool)
        drop[worse] = True
        faces, quality = faces[~drop], quality[~drop]
    return faces, quality, np.zeros(0, int)


def drop_minor_fans(faces, quality, num_units):
    """Keep the biggest fan of every vertex."""
    while len(faces):
        pair, side, alike = pairs_at_edges(faces, num_units)
        s0, s1 = side[:, 0], side[:, 1]
        c0u, c0v = 3 * pair[:, 0] + s0, 3 * pair[:, 0] + (s0 + 1) % 3
        c1u, c1v = 3 * pair[:, 1] + s1, 3 * pair[:, 1] + (s1 + 1) % 3
        x = np.where(alike, c1v, c1u)
        y = np.where(alike, c1u, c1v)
        n = 3 * len(faces)
        g = coo_array((np.ones(2 * len(pair)), (np.r_[c0u, c0v], np.r_[x, y])), shape=(n, n))
        _, label = connected_components(g, directed=False)
        vertex = faces.ravel()
        size = np.bincount(label)
        score = size[label] + 1e-3 * np.tile(np.minimum(quality, 100)[:, None], (1, 3)).ravel() / 100
        best = np.zeros(num_units)
        np.maximum.at(best, vertex, score)
        # the fan that holds the best corner of the vertex
        is_best = score >= best[vertex]
        keeper = np.full(num_units, -1)
        keeper[vertex[is_best]] = label[is_best]
        drop = (label != keeper[vertex]).reshape(-1, 3).any(1)
        if not drop.any():
            return faces, quality
        faces, quality = faces[~drop], quality[~drop]
    return faces, quality


def boundary_loops(faces, num_units):
    """Return loops of vertices, directed so that a new face (a, b, ...) along them is wound consistently."""
    order, first, count, _, _ = group_sides(faces, num_units)
    slot = order[first[count == 1]]
    u = faces.ravel()[slot]
    v = faces[slot // 3, (slot + 1) % 3 if False else (slot % 3 + 1) % 3]
    following = dict(zip(v.tolist(), u.tolist(), strict=True))
    loops = []
    seen = set()
    for s in following:
        if s in seen:
            continue
        loop = []
        x = s
        while x not in seen:
            seen.add(x)
            loop.append(x)
            x = following[x]
        loops.append(loop)
    return loops


def fill_loop(loop, units, edge_set, U):
    """Ear clipping with the largest smallest angle; None when it would use an edge twice."""
    loop = list(loop)
    new = []
    added = set()

    def angle(p, q, r):
        e = units[q] - units[p]
        f = units[r] - units[p]
        return np.arccos(np.clip(e @ f / max(np.linalg.norm(e) * np.linalg.norm(f), 1e-300), -1, 1))

    def key(a, b):
        return a * U + b if a < b else b * U + a

    while len(loop) > 3:
        best = None
        n = len(loop)
        for i in range(n):
            a, b, c = loop[i - 1], loop[i], loop[(i + 1) % n]
            k = key(a, c)
            if k in edge_set or k in added:
                continue
            s = min(angle(a, b, c), angle(b, c, a), angle(c, a, b))
            if best is None or s > best[0]:
                best = (s, i)
        if best is None:
            return None
        i = best[1]
        a, b, c = loop[i - 1], loop[i], loop[(i + 1) % n]
        new.append((a, b, c))
        added.add(key(a, c))
        del loop[i]
    new.append(tuple(loop))
    return new


def fill_holes(units, faces, max_edges=10):
    U = len(units)
    keys, _ = sides(faces, U)
    edge_set = None
    new = []
    for loop in boundary_loops(faces, U):
        if len(loop) <= max_edges:
            if edge_set is None:
                edge_set = set(keys.ravel().tolist())
            got = fill_loop(loop, units, edge_set, U)
            if got is not None:
                new += got
    if not new:
        return faces
    return np.concatenate([faces, np.array(new)])


def build_surface(units, triples):
    units = np.asarray(units, dtype=np.float64)
    edges, faces = find_cliques(triples, len(units))
    table = neighbor_table(edges, len(units), units)
    margin = emptiness(units, faces, table)
    faces, quality = faces[margin > 1], margin[margin > 1]
    faces, quality = limit_to_two(units, faces, quality)
    faces, quality = unfold(units, faces, quality)
    faces, quality, _ = orient(units, faces, quality)
    faces, quality = drop_minor_fans(faces, quality, len(units))
    faces = fill_holes(units, faces)
    used = np.unique(faces)
    remap = np.full(len(units), -1)
    remap[used] = np.arange(len(used))
    return units[used], remap[faces], used
