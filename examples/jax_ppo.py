"""A small PPO loop in JAX on the environment's pure functions: python examples/jax_ppo.py."""

import jax
import jax.numpy as jnp
import optax

import getup_jax as gj
from getup_jax.networks.gaussian import log_prob
from getup_jax.networks.mlp import MLP
from getup_jax.rl.gae import gae

ENVS, STEPS, UPDATES, EPOCHS, PARTS = 128, 24, 20, 5, 6
env = gj.make_env("quick", ENVS, training=True)
reset, step = env.functional()
actor, critic = MLP((256, 256), env.action_size, "tanh", 0.01), MLP((256, 256), 1, "tanh")
std, optimiser = jnp.full(env.action_size, 0.6), optax.adam(3e-4)


def loss(params, batch):
    obs, action, before, advantage, target = batch
    ratio = jnp.exp(log_prob(action, actor.apply(params[0], obs), std) - before)
    gain = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    policy = jnp.minimum(ratio * gain, jnp.clip(ratio, 0.8, 1.2) * gain).mean()
    return 0.5 * jnp.square(critic.apply(params[1], obs)[..., 0] - target).mean() - policy


def act(carry, key):
    world, params, obs, state = carry
    mean = actor.apply(params[0], obs)
    action = mean + std * jax.random.normal(key, mean.shape)
    after, state, reward, _, info = step(world, state, action)
    value, following = (critic.apply(params[1], x) for x in (obs, info["final_observation"]))
    rest = (reward[:, None], value, following, info["terminated"], info["truncated"])
    return (world, params, after, state), ((obs, action, log_prob(action, mean, std)), rest)


def learn(carry, part):
    change, adam = optimiser.update(jax.grad(loss)(carry[0], part), carry[1])
    return (optax.apply_updates(carry[0], change), adam), None


def update(world, params, adam, obs, state, key):
    keys, order = jax.random.split(key, STEPS), jax.random.split(key, EPOCHS)
    (_, _, obs, state), (acted, seen) = jax.lax.scan(act, (world, params, obs, state), keys)
    flat = [x.reshape(STEPS * ENVS, -1).squeeze() for x in (*acted, *gae(*seen, 0.99, 0.95))]
    index = jax.vmap(lambda k: jax.random.permutation(k, STEPS * ENVS))(order)
    parts = [x[index.reshape(EPOCHS * PARTS, -1)] for x in flat]
    (params, adam), _ = jax.lax.scan(learn, (params, adam), parts)
    return (params, adam, obs, state), (seen[0].mean(), seen[3].sum())


key = jax.random.PRNGKey(0)
obs, state = jax.jit(reset)(env.world, key)
params = actor.init(key, obs), critic.init(key, obs)
carry, update = (params, optimiser.init(params), obs, state), jax.jit(update)
for number in range(UPDATES):
    carry, (reward, falls) = update(env.world, *carry, jax.random.fold_in(key, number))
    print(f"{number + 1:3}: reward {reward:.3f} a step, {falls:4} falls")
