"""The paper's equations, written out over many points, against what the code evaluates."""

import numpy as np
import paper
import pytest
from analytical import (
    cable_row,
    cable_row_x,
    cable_row_xx,
    continuum_row,
    continuum_row_x,
    continuum_row_y,
    gauss,
    jacobian,
    quintic_row,
    tilde,
)

from hfsim.deck.materials import BeamProperties
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.elements import ELASTIC_FORMS, ELEMENTS, Cable, elastic_form
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.studies.separation.gram import GramStiffness
from hfsim.studies.separation.separated import SeparatedStiffness

INERTIA = BeamProperties(mass_per_length=1.7, rotary_inertia=0.0, height=0.3)
STIFFNESS = BeamProperties(
    axial_stiffness=300.0, bending_stiffness=2.0, lame_lambda=500.0, lame_mu=400.0, height=0.3, width=0.2
)
COUNT, LE = 3, 0.5


@pytest.fixture(params=[*ELEMENTS, "quintic"])
def mesh(request):
    element = Cable(LE, degree=5) if request.param == "quintic" else ELEMENTS[request.param](LE)
    return BeamMesh(element, COUNT, INERTIA)


def hybrid_state(mesh, rng, count=4):
    """States and rates with every coordinate of order one."""
    n = 2 * mesh.n_vectors
    keep = paper.elastic_columns(mesh)
    q = rng.normal(size=(count, n))
    q[:, 3:] = mesh.undeformed.ravel()[keep] + 0.2 * q[:, 3:]
    return q, rng.normal(size=(count, n))


# ---------------------------------------------------------------- mass and inertia, in space


def material_points(mesh):
    """Yield mass and the 3 x n_p matrix N of points all over the beam, from shapes written out here."""
    section, line = mesh.element.per_node == 3, quintic_row if mesh.element.degree == 5 else cable_row
    y, wy = gauss(6, -0.15, 0.15) if section else (np.zeros(1), np.full(1, 0.3))
    x, wx = gauss(10, 0.0, LE)
    for e in range(COUNT):
        for a, p in zip(x, wx, strict=True):
            for b, q in zip(y, wy, strict=True):
                local = continuum_row(a, b, LE) if section else line(a, LE)
                row = np.zeros(mesh.n_vectors)
                start = e * mesh.element.stride
                row[start : start + len(local)] = local
                N = np.zeros((3, 2 * mesh.n_vectors))
                N[:2] = np.kron(row, np.eye(2))
                yield INERTIA.mass_per_length / 0.3 * p * q, np.delete(N, [0, 1, 3], axis=1)


def spatial_sums(mesh, q, v, f):
    """M, Q_i and Q_f of (9)-(14), (31) with explicit skew matrices, reduced to (x, y, turn, p)."""
    n_p = len(q) - 3
    p, dp, theta = q[3:], v[3:], q[2]
    A = np.array([[np.cos(theta), -np.sin(theta), 0], [np.sin(theta), np.cos(theta), 0], [0, 0, 1]])
    w = tilde(np.array([0, 0, v[2]]))
    M, Qi, Qf = np.zeros((6 + n_p, 6 + n_p)), np.zeros(6 + n_p), np.zeros(6 + n_p)
    r0, turn, elastic = slice(0, 3), slice(3, 6), slice(6, None)
    for mass, N in material_points(mesh):
        s = tilde(N @ p)
        M[r0, r0] += mass * np.eye(3)
        M[r0, turn] -= mass * A @ s
        M[r0, elastic] += mass * A @ N
        M[turn, turn] -= mass * s @ s
        M[turn, elastic] += mass * s @ N
        M[elastic, elastic] += mass * N.T @ N
        a = w @ w @ N @ p + 2 * w @ N @ dp
        Qi[r0] -= mass * A @ a
        Qi[turn] -= mass * s @ a
        Qi[elastic] -= mass * N.T @ a
        Qf[r0] += mass * f
        Qf[turn] += mass * s @ A.T @ f
        Qf[elastic] += mass * N.T @ A.T @ f
    M = np.triu(M) + np.triu(M, 1).T
    keep = [0, 1, 5, *range(6, 6 + n_p)]
    return M[np.ix_(keep, keep)], Qi[keep], Qf[keep]


def close(a, b, tolerance):
    scale = np.abs(b).max()
    assert scale > 0
    assert np.abs(a - b).max() <= tolerance * scale


def test_mass_matrix_and_forces_are_the_integrals_of_the_paper(mesh, rng):
    q, v = hybrid_state(mesh, rng)
    g = np.array([1.3, -9.81])
    M, Qi = paper.mass_matrix(mesh, q), paper.inertia_force(mesh, q, v)
    Qf = paper.body_force(mesh, q, g)
    for k in range(len(q)):
        expected = spatial_sums(mesh, q[k], v[k], np.array([*g, 0.0]))
        for mine, theirs in zip((M[k], Qi[k], Qf[k]), expected, strict=True):
            close(mine, theirs, 1e-13)


def test_inertia_force_is_what_lagrange_says(mesh, rng):
    q, v = (a[0] for a in hybrid_state(mesh, rng))

    def momentum_of(states):
        return paper.mass_matrix(mesh, states) @ v

    def kinetic(states):
        return 0.5 * momentum_of(states) @ v

    expected = jacobian(kinetic, q) - jacobian(momentum_of, q) @ v
    close(paper.inertia_force(mesh, q[None], v[None])[0], expected, 1e-9)


# ---------------------------------------------------------------- accelerations of the system

DECK = """
hfsim: 1
name: case
gravity: [0.4, -9.81]
materials: {{soft: {{density: 900.0, youngs_modulus: 2.0e6, poisson_ratio: 0.3}}}}
sections: {{bar: {{shape: rectangle, width: 0.05, height: 0.08}}}}
bodies:
  b1: {{type: beam, material: soft, section: bar, length: 1.5, elements: 3, element: {element}}}
joints: {{{joints}}}
solve: {{model: exact, duration: 1.0, coordinates: frame}}
"""


def system_of(element, joints):
    scene = build(parse_deck(DECK.format(element=element, joints=joints)))
    material, section = scene.deck.materials["soft"], scene.deck.sections["bar"]
    stiffness = BeamProperties(
        axial_stiffness=material.youngs_modulus * section.area,
        bending_stiffness=material.youngs_modulus * section.second_moment,
        lame_lambda=material.lame_lambda,
        lame_mu=material.lame_mu,
        height=section.height,
        width=section.width,
    )
    return scene, stiffness


def elastic_force(mesh, stiffness, q, form):
    """Q_e of eq. (29), element by element."""
    P = paper.relative_vectors(mesh, q)
    k = mesh.element.per_node
    p = np.stack([P[:, e * k : (e + 2) * k].reshape(len(q), -1) for e in range(mesh.count)], axis=1)
    F = form.of(mesh.element, stiffness).force(p.reshape(-1, p.shape[-1]).T).T.reshape(p.shape)
    total = np.zeros_like(P)
    for e in range(mesh.count):
        total[:, e * k : (e + 2) * k] += F[:, e].reshape(len(q), -1, 2)
    Q = np.zeros_like(q)
    Q[:, 3:] = -total.reshape(len(q), -1)[:, paper.elastic_columns(mesh)]
    return Q


@pytest.mark.parametrize("form", list(ELASTIC_FORMS))
@pytest.mark.parametrize("element", list(ELEMENTS))
def test_free_beam_accelerates_as_in_the_paper(element, form, rng):
    scene, stiffness = system_of(element, "")
    mesh = scene.bodies["b1"].mesh
    q, v = hybrid_state(mesh, rng)
    Q = paper.inertia_force(mesh, q, v) + paper.body_force(mesh, q, scene.deck.gravity)
    Q += elastic_force(mesh, stiffness, q, elastic_form(form))
    a = np.linalg.solve(paper.mass_matrix(mesh, q), Q[..., None])[..., 0]
    close(scene.system.acceleration(np.zeros(len(q)), q, v), a, 1e-10)


@pytest.mark.parametrize("element", list(ELEMENTS))
def test_pinned_beam_accelerates_as_in_the_paper(element, rng):
    """Eq. (37) with Phi = r0 + A s'(tip) and with Phi = r0; multipliers too."""
    for point, joints in (
        (1.5, "pin: {type: revolute, between: [ground, b1.tip]}"),
        (0.0, "pin: {type: revolute, between: [ground, b1.root]}"),
    ):
        scene, stiffness = system_of(element, joints)
        mesh = scene.bodies["b1"].mesh
        q, v = hybrid_state(mesh, rng, count=3)
        Q = paper.inertia_force(mesh, q, v) + paper.body_force(mesh, q, scene.deck.gravity)
        Q += elastic_force(mesh, stiffness, q, elastic_form("direct"))
        M = paper.mass_matrix(mesh, q)
        N = np.delete(np.kron(mesh.shape(point), np.eye(2)), [0, 1, 3], axis=1)
        a, forces = np.zeros_like(q), np.zeros((3, 2))
        for k in range(3):
            c, s, w = np.cos(q[k, 2]), np.sin(q[k, 2]), v[k, 2]
            A, turn = np.array([[c, -s], [s, c]]), np.array([[0.0, -1.0], [1.0, 0.0]])
            arm, rate = N @ q[k, 3:], N @ v[k, 3:]
            Phi_q = np.concatenate([np.eye(2), (A @ turn @ arm)[:, None], A @ N], axis=1)
            gamma = -A @ (-(w**2) * arm + 2 * w * turn @ rate)
            whole = np.block([[M[k], Phi_q.T], [Phi_q, np.zeros((2, 2))]])
            solution = np.linalg.solve(whole, np.concatenate([Q[k], gamma]))
            a[k], forces[k] = solution[:-2], solution[-2:]
        t = np.zeros(3)
        close(scene.system.acceleration(t, q, v), a, 1e-10)
        x, u = scene.system.absolute(q), scene.system.absolute_velocity(q, v)
        close(scene.system.unreduced.solve(t, x, u, scene.system.force(t, x, u))[1], forces, 1e-10)


# ---------------------------------------------------------------- stiffness, eq. (15)-(27), (39)-(41)


def literal_points(element):
    """Yield volume and the matrices S_ij of eq. (26) at points of one element."""
    if element.per_node == 2:
        for a, w in zip(*gauss(9, 0, LE), strict=True):
            N1 = np.kron(cable_row_x(a, LE), np.eye(2))
            yield w, [[N1.T @ N1]]
        return
    for a, w in zip(*gauss(9, 0, LE), strict=True):
        for b, z in zip(*gauss(5, -0.15, 0.15), strict=True):
            by = [np.kron(row(a, b, LE), np.eye(2)) for row in (continuum_row_x, continuum_row_y)]
            yield w * z * STIFFNESS.width, [[by[i].T @ by[j] for j in range(2)] for i in range(2)]


def moduli(element):
    """E_ij, the shear modulus of pair (1, 2) and the constant bending matrix."""
    if element.per_node == 2:
        bends = [(w, np.kron(cable_row_xx(a, LE), np.eye(2))) for a, w in zip(*gauss(4, 0, LE), strict=True)]
        return np.array([[300.0]]), 0.0, sum(2.0 * w * B.T @ B for w, B in bends)
    return np.array([[1300.0, 500.0], [500.0, 1300.0]]), 400.0, np.zeros((12, 12))


def literal_stiffness(element, p):
    """Eq. (25), term by term."""
    E, mu, K = moduli(element)
    K = K.copy()
    for w, S in literal_points(element):
        for i in range(len(E)):
            for j in range(len(E)):
                K += 0.5 * w * E[i, j] * (p @ S[j][j] @ p - 1) * S[i][i]
        if len(E) == 2:
            K += w * mu * (p @ S[0][1] @ p) * (S[0][1] + S[1][0])
    return K


def literal_energy(element, p):
    """Strain energy from eq. (18)-(23) and the bending energy of a centre line."""
    E, mu, bending = moduli(element)
    U = 0.5 * p @ bending @ p
    for w, S in literal_points(element):
        e = [0.5 * (p @ S[i][i] @ p - 1) for i in range(len(E))]
        U += 0.5 * w * np.dot(e, E @ e)
        if len(E) == 2:
            U += 0.5 * w * mu * (p @ S[0][1] @ p) ** 2
    return U


def element_state(element, rng, count=1):
    base = BeamMesh(element, 1, INERTIA).undeformed.ravel()
    return base + 0.2 * rng.normal(size=(count, len(base)))


@pytest.mark.parametrize("form", list(ELASTIC_FORMS))
@pytest.mark.parametrize("name", list(ELEMENTS))
def test_every_form_of_the_stiffness_is_equation_25(name, form, rng):
    element = ELEMENTS[name](LE)
    p = element_state(element, rng)
    stiffness = elastic_form(form).of(element, STIFFNESS)
    K = literal_stiffness(element, p[0])
    close(stiffness.stiffness(p.T)[0], K, 1e-12)
    close(stiffness.force(p.T)[:, 0], K @ p[0], 1e-12)
    close(stiffness.tangent(p.T)[0], jacobian(lambda s: stiffness.force(s.T).T, p[0]), 1e-9)


@pytest.mark.parametrize("name", list(ELEMENTS))
def test_stiffness_times_p_is_the_slope_of_the_energy(name, rng):
    element = ELEMENTS[name](LE)
    p = element_state(element, rng)[0]
    slope = jacobian(lambda states: np.array([literal_energy(element, s) for s in states]), p)
    close(literal_stiffness(element, p) @ p, slope, 1e-9)
    law = GramStiffness.of(element, STIFFNESS)
    V = element.differences() @ p.reshape(1, -1, 2)
    assert law.law.energy(V)[0] == pytest.approx(literal_energy(element, p), rel=1e-12)


@pytest.mark.parametrize("name", list(ELEMENTS))
def test_separated_matrices_are_equations_40_and_41(name):
    element = ELEMENTS[name](LE)
    form = SeparatedStiffness.of(element, STIFFNESS)
    E, mu, c = moduli(element)
    n = len(c)
    C, c = np.zeros((n, n, n, n)), c.copy()
    for w, S in literal_points(element):
        for i in range(len(E)):
            for j in range(len(E)):
                C += 0.5 * w * E[i, j] * np.multiply.outer(S[i][i], S[j][j])
                c -= 0.5 * w * E[i, j] * S[i][i]
        if len(E) == 2:
            C += w * mu * np.multiply.outer(S[0][1] + S[1][0], S[0][1])
    close(form.C, C, 1e-12)
    close(form.c, c, 1e-12)


@pytest.mark.parametrize("name", list(ELEMENTS))
def test_forms_agree_on_batches_of_states_and_elements(name, rng):
    element = ELEMENTS[name](LE)
    p = element_state(element, rng, 15).T
    direct, *others = (elastic_form(name).of(element, STIFFNESS) for name in ELASTIC_FORMS)
    for other in others:
        for what in ("stiffness", "force", "tangent"):
            close(getattr(other, what)(p), getattr(direct, what)(p), 1e-12)
    for form in (direct, *others):
        force, both = form.force_and_tangent(p)
        close(force, direct.force(p), 1e-12)
        close(both, direct.tangent(p), 1e-12)
    tangent = direct.tangent(p)
    close(tangent, tangent.swapaxes(-1, -2), 1e-13)

