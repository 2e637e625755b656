"""What is known of a mass: its entries in the ledger, its energies, its health."""

__all__ = ["ACCOUNTS"]

ACCOUNTS = r"""
// Work of a loss that changed the velocity of a mass by -lost while it went from `before` to
// `after`: impulse times mean velocity. All impulses so weighed add up to the change of kinetic
// energy exactly, and a mass that sticks loses nothing.
auto loss_work = [=](Vec lost, Vec before, Vec after, real w)
        __attribute__((always_inline)) -> real {
    const real work = (lost.x * (before.x + after.x) + lost.y * (before.y + after.y)
                       + lost.z * (before.z + after.z)) * scalar(0.5) / w;
    return MERGED ? select(w > zero, work, zero) : work;
};
// The accounts of the ledger [J], in the order of ``buffers.ACCOUNTS``: work of the breathing
// springs, what damping, drag and friction took from a mass of inverse w, work from outside.
auto enter = [=](real* ledger, const Losses& losses, Vec before, Vec after, real w)
        __attribute__((always_inline)) {
    if (!LEDGER) return;
    if (DAMPING) ledger[1] += loss_work(losses.damping, before, after, w);
    if (DRAG || WATER) ledger[2] += loss_work(losses.drag, before, after, w);
    if (GROUND || OBSTACLES) ledger[3] += loss_work(losses.friction, before, after, w);
    if (OUTER) ledger[4] -= loss_work(losses.outer, before, after, w);
};
// A mass that slides is kicked, then rubbed; one that sticks is both at once, and friction takes
// back what the kick gave.
auto enter_step = [=](real* ledger, const Losses& losses, const Losses& rubbed, Vec before,
                      Vec kicked, Vec after, real w) __attribute__((always_inline)) {
    if (!LEDGER) return;
    if (OBSTACLES) {
        enter(ledger, losses, before, pick(rubbed.stuck, before, kicked), w);
        enter(ledger, rubbed, pick(rubbed.stuck, before, rubbed.mean),
              pick(rubbed.stuck, after, rubbed.mean), w);
        return;
    }
    const mask slides = (after.x != zero) | (after.y != zero);
    auto pick_level = [=](Vec a, Vec b) -> Vec {
        return Vec{select(slides, a.x, b.x), select(slides, a.y, b.y), a.z};
    };
    const Vec level = {after.x, after.y, kicked.z};
    enter(ledger, losses, before, pick_level(kicked, level), w);
    enter(ledger, rubbed, pick_level(kicked, before), level, w);
};

// Health of a mass. Who was shot away and braked since the last check shows by the way it went.
auto too_fast = [=](Vec v, Vec way) __attribute__((always_inline)) -> mask {
    const scalar reach = speed_limit * dt * scalar(CHECK_EVERY);
    return (v.x * v.x + v.y * v.y + v.z * v.z > zero + speed_limit * speed_limit)
        | (way.x * way.x + way.y * way.y + way.z * way.z > zero + reach * reach);
};
// Zero where all numbers are finite, else not a number.
auto poison_of = [=](Vec x, Vec v) __attribute__((always_inline)) -> real {
    return (x.x + x.y + x.z + v.x + v.y + v.z) * scalar(0);
};

// Energies of a mass m [J].
auto kinetic_energy = [=](Vec v, real m) __attribute__((always_inline)) -> real {
    return m * (v.x * v.x + v.y * v.y + v.z * v.z) * scalar(0.5);
};
auto gravity_energy = [=](const Place& x, real m) __attribute__((always_inline)) -> real {
    const real weight = -(m * (x.x * gravity_x + x.y * gravity_y + x.z * gravity_z));
    return WATER ? weight + buoyancy_energy(x.z, m) : weight;
};
auto contact_energy = [=](const Place& x, const Own& own) __attribute__((always_inline)) -> real {
    if (OBSTACLES) return obstacle_energy(x, own);
    return GROUND ? ground_force(x.z, own) * x.z * scalar(-0.5) : zero;
};
"""
