"""How a mass moves: kicks, drifts, what slows it between them, and the steps made of these."""

__all__ = ["MOTION"]

MOTION = r"""
// Exact flow of du/dt = -c |u| u / m over h, of the velocity u = `against` to what v moves in: |u|
// falls to |u| / (1 + c |u| h / m). A speed whose square overflows must not come out as rest: it
// turns into NaN, which the health check sees.
auto drag_flow = [=](Sum& v, Vec against, real w, real ch) __attribute__((always_inline)) {
    real speed2 = against.x * against.x + against.y * against.y + against.z * against.z;
    real slowing = square_root(speed2) * w * ch;
    real part = slowing / (slowing + scalar(1)) + speed2 * scalar(0);
    add(v, scaled(against, part), scalar(-1));
};
// Drag against the air, which the wind moves, and against the water, which is still.
auto slow_in_air = [=](Sum& v, real w, scalar time) __attribute__((always_inline)) {
    const Vec wind = {zero + wind_x, zero + wind_y, zero + wind_z};
    if (DRAG) drag_flow(v, WIND ? v - wind : Vec(v), w, zero + drag * time);
};
auto slow_in_water = [=](Sum& v, real z, real w, scalar time) __attribute__((always_inline)) {
    if (WATER) drag_flow(v, v, w, immersed(z) * (water_drag * time));
};
auto slow_down = [=](Sum& v, const Place& x, real w, scalar time, bool water_first, const Own& own,
                     Losses& losses) __attribute__((always_inline)) {
    if (!DRAG && !WATER) return;
    const Vec before = v;
    if (water_first) slow_in_water(v, x.z, w, time);
    slow_in_air(v, w, time);
    if (!water_first) slow_in_water(v, x.z, w, time);
    if (BOUND && WIND) restrain(v, x, own);
    if (LEDGER) losses.drag = losses.drag + (before - v);
};

// Kicks and drifts. The springs kick; a drift of `span` seconds moves by the velocity, and gravity
// and the ground's normal force belong to it. Damping and drag act for half a span on either side
// of a kick (Strang splitting). The last kick of a step and the first of the next meet, so the
// state kept is the position at t_n and the velocity just before both: the very first kick of a
// simulation, and the one that synchronises a velocity that is looked at, are the last or first
// part alone, with the damping of their own side only.
//
// leapfrog   kick dt, drift dt                                           second order
// chin4      kick dt/3, drift dt/2, gradient kick 2 dt/3, drift dt/2     fourth order
//
// chin4 is algorithm 4A of S. A. Chin, Phys. Lett. A 226 (1997) 344. The gradient kick takes the
// forces at x + a dt^2/24, a the acceleration that the kick would give at x.
const scalar FIRST_KICK = CHIN4 ? dt / scalar(6) : dt * scalar(0.5);  // half of the joined kick
const scalar GRADIENT_KICK = dt * scalar(2) / scalar(3);
const scalar GRADIENT_SHIFT = dt * dt / scalar(24);

auto kick_acceleration = [=](Vec f, const Place& at, real w, const Own& own)
        __attribute__((always_inline)) -> Vec {
    Vec a = {f.x * w + gravity_x, f.y * w + gravity_y, GROUND ? f.z * w : f.z * w + gravity_z};
    if (OUTER || WATER) a = a + outer_acceleration(at.z, w, own);
    if (BOUND && GROUND)  // what flies on a great circle takes all forces here
        a.z += select(narrow(is_round(own)), ground_force(at.z, own) * w + gravity_z, zero);
    return BOUND ? tangent(a, at, own) : a;
};
auto damp = [=](Sum& v, scalar part, Losses& losses) __attribute__((always_inline)) {
    if (!DAMPING) return;
    const Vec before = v;
    add(v, before, -part);
    if (LEDGER) losses.damping = losses.damping + (before - v);
};
// The classroom's friction belongs to the kick, since it works on the force. The force f was taken
// at `at`, which is x but for the gradient kick. Returns the acceleration without friction.
auto kick = [=](Sum& v, Vec f, const Place& at, const Place& x, real w, scalar time,
                const Own& own, Losses& losses) __attribute__((always_inline)) -> Vec {
    Vec a = kick_acceleration(f, at, w, own);
    if (BOUND) a = tangent(a, x, own);
    const Vec whole = a;
    Sum free = v;
    if (GROUND && COURSE) {
        if (LEDGER) add(free, a, time);
        course_friction(a.x, a.y, v.x, v.y, ground_force(x.z, own) * w, own);
        settle_rest(v);
    }
    add(v, a, time);
    if (LEDGER && OUTER) losses.outer = losses.outer - scaled(own.outer, w * time);
    if (GROUND && COURSE && LEDGER) losses.friction = losses.friction + (free - v);
    return whole;
};
auto lose_before = [=](Sum& v, const Place& x, real w, const Own& own, Losses& losses)
        __attribute__((always_inline)) {
    damp(v, loss, losses);
    slow_down(v, x, w, span * scalar(0.5), false, own, losses);
};
auto lose_after = [=](Sum& v, const Place& x, real w, const Own& own, Losses& losses)
        __attribute__((always_inline)) {
    slow_down(v, x, w, span * scalar(0.5), true, own, losses);
    damp(v, loss, losses);
};

// Friction slows a sliding mass evenly during the drift, which therefore moves it with the mean of
// the velocities before and after: second order.
auto drift = [=](Sum& x, Sum& v, Vec a, real w, int substeps, real& left_over, bool last,
                 const Own& own, Losses& losses) __attribute__((always_inline)) {
    const Sum x0 = x, v0 = v;
    Vec mean = v;
    if (GROUND) touch_down(x, v, w, substeps, left_over, last, a.z, own, losses);
    else add_upright(x, v.z, span);
    if (COULOMB) {
        const mask slides = (v.x != zero) | (v.y != zero);
        mean.x = select(slides, (mean.x + v.x) * scalar(0.5), zero);
        mean.y = select(slides, (mean.y + v.y) * scalar(0.5), zero);
    }
    add_level(x, mean, span);
    if (OBSTACLES) meet_obstacles(x, v, x0, a, w, substeps, last, own, losses);
    if (BOUND) bind(x, v, x0, v0, own);
};
// The velocity at t_n, from the state before its kicks: what the last part of them adds. The state
// has had its friction up to t_n; here friction only holds what sticks, so that it is reported at
// rest.
auto synchronise = [=](Sum& v, Vec f, const Place& x, real w, const Own& own, Losses& losses)
        __attribute__((always_inline)) {
    lose_before(v, x, w, own, losses);
    kick(v, f, x, x, w, FIRST_KICK, own, losses);
    if (GROUND)
        rub(v, ground_force(x.z, own) * w * FIRST_KICK, zero, own, losses, scalar(0));
    if (OBSTACLES) hold_by_obstacles(x, v, w, FIRST_KICK, own, losses);
    if (BOUND) restrain(v, x, own);
};

// Symplectic Euler, the classroom's method: all forces at t_n, then velocity, then position.
auto euler_step = [=](Sum& x, Sum& v, Vec f, real w, const Own& own, Losses& losses)
        __attribute__((always_inline)) {
    const Place here = in_world(x);
    const real push = GROUND ? ground_force(here.z, own) * w : zero;
    Vec a = {f.x * w + gravity_x, f.y * w + gravity_y, f.z * w + gravity_z + push};
    if (OUTER || WATER) a = a + outer_acceleration(here.z, w, own);
    if (LEDGER && OUTER) losses.outer = losses.outer - scaled(own.outer, w * dt);
    Sum free = v;
    if (GROUND && COURSE) {
        if (LEDGER) add(free, a, dt);
        course_friction(a.x, a.y, v.x, v.y, push, own);
        settle_rest(v);
    }
    add(v, a, dt);
    if (GROUND && COURSE && LEDGER) losses.friction = losses.friction + (free - v);
    if (GROUND) rub(v, push * dt, push * dt, own, losses, kinetic_friction);
    if (OBSTACLES) push_by_obstacles(here, v, w, own, losses);
    if (BOUND) restrain(v, here, own);
    damp(v, loss * (scalar(2) - loss), losses);
    slow_down(v, here, w, dt, false, own, losses);
    const Sum x0 = x, v0 = v;
    add(x, v, dt);
    if (BOUND) bind(x, v, x0, v0, own);
};

// One mass moved by its whole force f, taken at `at` in the world: a kick of `time` seconds and the
// drift after it. `start`: nothing came before; `last`: the last drift of the step; `left_over`:
// see touch_down.
auto move_mass = [=](Sum& x, Sum& v, Vec f, const Place& at, real w, int substeps,
                     real& left_over, scalar time, bool start, bool last, real* ledger,
                     const Own& own) __attribute__((always_inline)) {
    const Vec before = v;
    const Place here = in_world(x);
    Losses losses = {}, rubbed = {};
    if (!start) lose_before(v, here, w, own, losses);
    const Vec a = kick(v, f, at, here, w, time, own, losses);
    lose_after(v, here, w, own, losses);
    const Vec kicked = v;
    drift(x, v, a, w, substeps, left_over, last, own, rubbed);
    enter_step(ledger, losses, rubbed, before, kicked, v, w);
};
auto move_mass_euler = [=](Sum& x, Sum& v, Vec f, real w, real* ledger, const Own& own)
        __attribute__((always_inline)) {
    const Vec before = v;
    Losses losses = {};
    euler_step(x, v, f, w, own, losses);
    enter(ledger, losses, before, v, w);
};
// Where the gradient kick of chin4 looks.
auto shifted_position = [=](Sum x, Vec f, real w, const Own& own)
        __attribute__((always_inline)) -> Vec {
    add(x, kick_acceleration(f, in_world(x), w, own), GRADIENT_SHIFT);
    if (BOUND) x = sum_from(from_origin(nearest(exact_of(in_world(x)), own)));
    return x;
};
"""
